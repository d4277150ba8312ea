"""`python -m robust`: the command `robust`."""

from nlfrf.doctor import robust_command

if __name__ == "__main__":
    robust_command()
