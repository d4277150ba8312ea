"""Every measured figure again, in one go: the commands one after the other, and what each took.

python -m benchmarks                 # all of them; one that fails is named at the end, the others run
python -m benchmarks coverage faults # some
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

#: Each command by itself takes other numbers of records, loops and files than the few of here; it
#: prints how many.
COMMANDS = (
    "machine",
    "size",
    "bench_identify",
    "peers_matrix",
    "bench_files",
    "bench_friction",
    "bench_many_loops 2000",
    "bench_axes",
    "bench_servo",
    "bench_experiment",
    "bench_robust",
    "nominal",
    "bench_design",
    "bench_synthesis",
    "bench_gamma",
    "bench_hinf_singular --problems 60",
    "bench_mu",
    "bounds_mu lags 20",
    "bench_lmi",
    "bench_friction_proof --bursts 2",
    "bench_friction_attack --loops 100",
    "settling --runs 120",
    "friction_ports --axes 30",
    "read_class --machines 60",
    "read_machine --runs 4",
    "bench_saturation --every 24",
    "bench_verification 200",
    "soundness 100",
    "near_limit 10",
    "soundness_matrix 100 300",
    "bounds 20",
    "faults",
    "sound_records --records 15",
    "bench_screening --records 200",
    "attack_design_frf --designs 60",
    "attack_met --designs 60 --tunings 10",
    "attack_best_gain --plants 30",
    "tuning",
    "attack_tune --designs 60",
    "attack_learning --loops 20",
    "attack_schedule --loops 6 --designs 6",
    "level_of_loop --seeds 2",
    "mispaired",
    "records_as_found --records 120",
    "hum --plants 24",
    "unequal_experiments",
    "fuzz_loaders --files 100",
    "fuzz_readers --files 200",
    "fuzz_commands",
    "doors --files 2000 --seed 0",
    "names --files 1000 --seed 0",
    "validation --records 100",
    "joint --records 4",
    "coverage_matrix 8",
    "coverage --records 50 --processes 2",
    "coverage --hard --records 20 --processes 2",
)
#: More threads of linear algebra wait for one another by spinning, which the processor's clock
#: counts as work.
QUIET = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}


def asked(names: list[str]) -> list[str]:
    """The commands of these names, all without one."""
    known = {command.split()[0] for command in COMMANDS}
    if unknown := set(names) - known:
        raise SystemExit(
            f"name must be one of {', '.join(sorted(known))}, got {', '.join(sorted(unknown))}"
        )
    return [command for command in COMMANDS if not names or command.split()[0] in names]


def main(names: list[str]) -> int:
    """Run them; 1 where one failed."""
    took, failed = {}, []
    for command in asked(names):
        print(f"\n== python -m benchmarks.{command}", flush=True)
        begin = time.monotonic()
        done = subprocess.run(
            [sys.executable, "-m", *f"benchmarks.{command}".split()], env=os.environ | QUIET
        )
        took[command] = (time.monotonic() - begin) / 60
        failed += [command] * (done.returncode != 0)
    print(f"\n== {sum(took.values()):.0f} minutes")
    for command, minutes in took.items():
        print(f"{minutes:6.1f}  {command}{'  FAILED' if command in failed else ''}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
