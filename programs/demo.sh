#!/usr/bin/env bash
# From a survey to compensated programs, on a virtual arm with errors of its own.
# Needs `postproc` on the PATH (make demo sees to that); writes into demo/.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

cell=programs/cell.toml
seed=${SEED:-1} # which virtual arm: another seed, other errors
jobs="drilling handling spot milling"
rm -rf demo
mkdir demo
exec 3>&1 # commands are shown here also where their output goes to a file

# Show a command and run it.
run() {
    printf '\n$ %s\n' "$*" >&3
    "$@"
}

# The same, where exit code 1 is a result: targets are not corrected, files differ.
run_or_1() { run "$@" || [ $? -eq 1 ]; }

title() { printf '\n== %s\n' "$*"; }

title "A survey program: 300 poses, each approached from both sides"
run postproc survey --cell $cell --poses 300 -o demo/survey.pdl

title "The (virtual) arm runs it, the tracker reads"
run postproc simulate demo/survey.pdl --cell $cell --set simulation.seed="$seed" -o demo/survey.csv

title "A model of the arm's error, fitted to the readings"
run postproc fit demo/survey.csv --cell $cell -o demo/model.json

for job in $jobs; do
    title "$job.pdl: every target moved against the predicted error"
    run_or_1 postproc compensate programs/$job.pdl --cell $cell --model demo/model.json \
        -o demo/$job.pdl --report demo/$job.json
    run_or_1 postproc diff programs/$job.pdl demo/$job.pdl >demo/$job.diff
    head -n 14 demo/$job.diff
    echo "  ... all of it in demo/$job.diff"
done

title "Before an upload: a second opinion, by Pinocchio, toppra and ruckig"
mkdir demo/upload
for job in $jobs; do
    cp demo/$job.pdl demo/$job.pdl.postproc.json demo/upload
done
cp demo/spot.lsv demo/upload
run postproc check demo/upload --cell $cell --model demo/model.json --allow-uncorrected \
    --set verify.second_opinion=true

title "What the tool really misses by: programs as written, and compensated"
for job in $jobs; do
    for state in written compensated; do
        program=programs/$job.pdl
        [ $state = written ] || program=demo/$job.pdl
        run postproc simulate "$program" --cell $cell --set simulation.seed="$seed" \
            --reference programs/$job.pdl --path --report demo/$job.$state.json
    done
done

title "Another language: a welding task of two RAPID modules on an IRB 6640, explained"
run postproc explain programs/welding/Welding.mod --cell programs/welding/cell.toml \
    >demo/welding.txt
head -n 12 demo/welding.txt
echo "  ... all of it in demo/welding.txt"

title "And another: a milling job in KRL on a KR 210, three sources with their data lists"
run postproc explain programs/facing/Milling.src --cell programs/facing/cell.toml \
    >demo/facing.txt
head -n 12 demo/facing.txt
echo "  ... all of it in demo/facing.txt"

title "True error of the tool at the targets, and of its path between them, mm"
python - $jobs <<'TABLE'
import json
import sys

def figures(e):
    if not e["n"]:
        return f"{'-':>8}{'-':>8}{'-':>8}{0:9d}"
    return f"{e['mean_mm']:8.3f}{e['p95_mm']:8.3f}{e['max_mm']:8.3f}{e['n']:9d}"


sizes = f"{'mean':>8}{'95 %':>8}{'max':>8}"
print(f"{'program':12}{'':14}{sizes}{'targets':>9}{sizes}{'paths':>9}")
for job in sys.argv[1:]:
    for state in ("written", "compensated"):
        with open(f"demo/{job}.{state}.json", encoding="utf-8") as file:
            told = json.load(file)
        row = figures(told["true_error"]) + figures(told["path_accuracy"])
        print(f"{job:12}{state:14}{row}")
TABLE
