# Short names for the commands of daily work; https://just.systems
export PATH := justfile_directory() / ".venv/bin:" + env("PATH")
export OMP_NUM_THREADS := "1"

# list the recipes
default:
    @just --list

# style, layers, and the tests without windows and processes, within two minutes
quick:
    ruff check && ruff format --check && lint-imports && python -m pytest -q -n 3 -m quick

# set-up, then every check, and every test that is not slow
test *arguments:
    bash installer/test.sh {{arguments}}

# every test, the slow ones too
test-all:
    bash installer/test.sh -m ""

# both commands of the README on bare systems of Debian 12 and 13, as root; about half an hour
matrix *arguments:
    bash installer/matrix.sh {{arguments}}

# the documentation site, in results/site
docs:
    mkdocs build --strict

# the guides' pictures, from the running program
pictures:
    bash docs/pictures.sh && QT_QPA_PLATFORM=offscreen python docs/rig_pictures.py

# the promises of docs/reliability.md attacked, in about an hour; --short: within a minute
campaigns *arguments:
    nice python -m tests.campaigns {{arguments}}

# break a copy of the program in 20 known ways, and see that something notices each; half an hour
mutants *words:
    nice python -m tests.mutants {{words}}

# every figure of the documentation that a command measures: the benchmarks and both studies
figures:
    handcal bench --json results/bench.json && handcal study noise && handcal study methods
