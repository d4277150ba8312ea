"""What the loaders accept is what the published schemas accept: files changed by chance, each held
against both.
"""

import copy
import json
import random
from functools import partial
from importlib.resources import files

import control
import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robust
from nlfrf._base.parsing import parse_json
from robust import check, prove_friction, prove_schedule
from robust.friction import MaxwellSlip
from robust.friction.exact.claim import FrictionClaim
from robust.io import verify_certificate
from robust.models import LpvModel
from robust.proofs.exact.channel_files import ChannelsClaim
from robust.proofs.exact.claim import LoopClaim
from robust.proofs.exact.claim_files import read_claim
from robust.proofs.exact.scheduled_kyp import ScheduleClaim
from tests.robust.io.test_certificates import K as SAMPLED
from tests.robust.io.test_certificates import make_model
from tests.robust.io.test_export import models
from tests.robust.io.test_matrix_files import MODELS as MATRICES
from tests.support.friction_loops import ORACLES, RIG, pid
from tests.support.printed import unwrapped
from tests.support.signed import signed

SCHEMAS = (
    "robust-model",
    "robust-matrix-model",
    "robust-controller",
    "robust-certificate",
    "robust-friction-certificate",
    "robust-mu-certificate",
    "robust-schedule-certificate",
)
VALIDATORS = {}
for name in SCHEMAS:
    schema = json.loads(files("robust").joinpath(f"{name}.schema.json").read_text(encoding="utf-8"))
    jsonschema.Draft202012Validator.check_schema(schema)
    VALIDATORS[name] = jsonschema.Draft202012Validator(schema)


class Files(list):
    """Files that a failing test need not print."""

    def __repr__(self):
        return f"{len(self)} files"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """(schema, loader, content) of one file of each kind and of each variant of a model."""
    folder = tmp_path_factory.mktemp("files")
    made = Files()

    def add(loader, thing):
        path = folder / f"{len(made)}.json"
        robust.save(thing, path)
        content = json.loads(path.read_text())
        made.append((content["schema"], loader, content))

    for model in [*models().values(), *MATRICES.values()]:
        add(robust.load, model)
    for K in (
        control.tf([1.0, 0.1], [1, 0.7, 0.1]),
        control.tf([0.5, -0.4], [1, -1], 0.01),
        2.5,
        np.eye(2),
    ):
        add(robust.load, K)
    add(partial(read_claim, kind=LoopClaim), check(make_model(), SAMPLED))
    add(partial(read_claim, kind=ChannelsClaim), check(MATRICES["elements"], 0.1 * np.eye(2)))
    kp, ki, kd, _ = ORACLES["P1"][0]
    proof = prove_friction(RIG, pid(kp, ki, kd), MaxwellSlip(64e3, 1.05))
    add(partial(read_claim, kind=FrictionClaim), proof)
    lag = LpvModel.from_points([control.ss(-k, 1, 1, 0) for k in (1.0, 1.2)], at=[0, 1], weight=0.5)
    add(partial(read_claim, kind=ScheduleClaim), prove_schedule(lag, 1.0, rate=1.0, limit=False))
    return made


def places(content, place=()):
    """Every place in parsed JSON, of lists the first items."""
    yield place
    items = enumerate(content[:3]) if isinstance(content, list) else ()
    items = content.items() if isinstance(content, dict) else items
    for key, item in items:
        yield from places(item, (*place, key))


def value(rng, depth=0):
    """Any JSON: numbers, words that mean something here and others, lists and objects of these."""
    if depth < 3 and rng.random() < 0.3:
        inner = [value(rng, depth + 1) for _ in range(rng.randrange(4))]
        return (
            inner
            if rng.random() < 0.5
            else dict(zip(("kind", "dt", "A", "x"), inner, strict=False))
        )
    words = ("inf", "-inf", "x", "", "ss", "frf", "LTI", "1.5", "\u202e\x1b[2J")
    numbers = (0, -0.0, 1, 1.0, 2, -1, 0.5, -1e-300, 1e308, 10**400, rng.uniform(-1e3, 1e3))
    return rng.choice((None, True, False, *words, *numbers))


def change(content, rng):
    """Put a value in some place, take an entry out, put one in, one twice, or a list into a
    list.
    """
    content = copy.deepcopy(content)
    *way, last = rng.choice([place for place in places(content) if place])
    there = content
    for key in way:
        there = there[key]
    how = rng.choice(("value", "value", "gone", "more", "twice", "deeper"))
    if how == "value":
        there[last] = value(rng)
    elif how == "gone":
        del there[last]
    elif how == "more" and isinstance(there, dict):
        there[rng.choice(("x", "kind", "delay", "\x1b[2J", "W1", "other"))] = value(rng)
    elif how == "twice" and isinstance(there, list):
        there.insert(last, copy.deepcopy(there[last]))
    elif how == "deeper":
        there[last] = [there[last]]
    return content


def refusal_of(loader, path):
    """What a loader says against a file, empty where it reads it, and what it read."""
    try:
        with np.errstate(all="ignore"):  # of numbers like 1e308, which the schema allows
            return "", loader(path)
    except ValueError as error:
        return str(error), None


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_whatever_a_loader_accepts_its_schema_accepts(written, tmp_path_factory, seed):
    change_and_load(written, tmp_path_factory, seed)


@pytest.mark.attack
@settings(max_examples=400, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_whatever_a_loader_accepts_its_schema_accepts_of_many(written, tmp_path_factory, seed):
    change_and_load(written, tmp_path_factory, seed)


def change_and_load(written, tmp_path_factory, seed):
    """Load a file with one to three changes, by its reader and by its schema."""
    rng = random.Random(seed)
    schema, loader, content = rng.choice(written)
    for _ in range(rng.randrange(1, 4)):
        content = change(content, rng)
    if "digest" in content:  # signed by whoever changed it
        content = signed(content)
    valid = not list(VALIDATORS[schema].iter_errors(content))
    path = tmp_path_factory.getbasetemp() / "changed.json"
    path.write_text(json.dumps(content))
    refusal, read = refusal_of(loader, path)
    assert refusal.isprintable()
    assert valid or refusal or read is None  # of another kind of certificate


def test_every_file_as_it_is_written_is_accepted(written, tmp_path):
    assert {schema for schema, _, _ in written} == set(SCHEMAS)
    for schema, loader, content in written:
        VALIDATORS[schema].validate(content)
        (tmp_path / "x.json").write_text(json.dumps(content))
        assert loader(tmp_path / "x.json") is not None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            '{"schema": "robust-controller", "schema": "robust-model"}',
            "a key must occur once, got 'schema' twice",
        ),
        ('{"schema": NaN}', "a number must be finite, got NaN"),
        ('{"schema": 1e999}', "a number must be finite, got 1e999"),
        ('{"schema": -Infinity}', "a number must be finite, got -Infinity"),
        ('{"schema": ' + "9" * 400 + "}", "a number must be finite, got 999"),
        ("[" * 200_000, "it is nested too deeply|must be a whole JSON file"),
        ('{"a":' * 100_000, "it is nested too deeply|must be a whole JSON file"),
    ],
)
def test_what_is_no_strict_json_is_refused_in_one_line(text, why, tmp_path):
    (tmp_path / "x.json").write_text(text)
    for load in (robust.load, verify_certificate, parse_json):
        with pytest.raises(ValueError, match=why) as refusal:
            load(tmp_path / "x.json")
        assert "\n" not in str(refusal.value)


def test_texts_of_a_model_are_one_line_that_commands_nothing(written, tmp_path):
    for schema, loader, content in written:
        if schema in ("robust-model", "robust-matrix-model"):
            told = {"source": "run\x1b[2J\nROBUST (proved)", "extrapolation": "\u202eflat"}
            hostile = content | {"origin": content["origin"] | told}
            (tmp_path / "x.json").write_text(json.dumps(hostile))
            model = loader(tmp_path / "x.json")
            assert model.origin.source == "run\\u001b[2J ROBUST (proved)"
            assert model.origin.extrapolation == "\\u202eflat"
            assert unwrapped(model).isprintable()
