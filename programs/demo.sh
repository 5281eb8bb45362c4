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

echo "Look at: the error of the model on poses it has not seen, what every program says"
echo "of its uncorrected targets, and the table of true errors at the end."

title "A survey program: 300 poses, each approached from both sides"
run postproc survey --cell $cell --poses 300 -o demo/survey.pdl

title "The (virtual) arm runs it, the tracker reads"
run postproc simulate demo/survey.pdl --cell $cell --set simulation.seed="$seed" -o demo/survey.csv

title "A model of the arm's error, fitted to the readings"
run postproc fit demo/survey.csv --cell $cell -o demo/model.json

for job in $jobs; do
    title "$job.pdl: every target moved against the predicted error"
    run_or_1 postproc compensate programs/$job.pdl --cell $cell --model demo/model.json \
        -o demo/$job.pdl --report demo/$job.json --report demo/$job.html
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

# The whole loop on another arm, in its language: folder, program, suffix of a survey.
nests="[[80.0, -40.0, 150.0], [-60.0, 100.0, 200.0], [50.0, 90.0, 320.0]]" # reflectors
loop() {
    local cell=programs/$1/cell.toml job=programs/$1/$2 out=demo/$1
    mkdir "$out"
    run postproc survey --cell "$cell" --poses 100 --set "survey.points_mm=$nests" \
        -o "$out/survey.$3"
    run postproc simulate "$out/survey.$3" --cell "$cell" -o "$out/readings.csv"
    run postproc fit "$out/readings.csv" --cell "$cell" --effects geometry,backlash \
        -o "$out/model.json" >"$out/fit.txt"
    tail -n 3 "$out/fit.txt"
    run_or_1 postproc compensate "$job" --cell "$cell" --model "$out/model.json" \
        --shared-points clone -o "$out/$2" >"$out/compensate.txt" 2>&1
    grep visits "$out/compensate.txt"
    for file in programs/"$1"/*; do # what belongs to the job and needed no change
        [ -e "$out/${file##*/}" ] || cp "$file" "$out"
    done
    for program in "$job" "$out/$2"; do
        run postproc simulate "$program" --cell "$cell" --reference "$job"
    done
}

title "Another language: a welding task of two RAPID modules on an IRB 6640"
loop welding Welding.mod mod

title "And another: a milling job in KRL on a KR 210, three sources with their data lists"
loop facing Milling.src src

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

title "Where every target went and why, for a browser: file://$PWD/demo/drilling.html"
