"""`python -m nlfrf`: the command `nlfrf`."""

from nlfrf.doctor import nlfrf_command

if __name__ == "__main__":
    nlfrf_command()
