//! The lab's commands: shards, resuming, stopping, budgets of time, reports. Counts and errors, never time itself.

use serde_json::Value;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

fn tenter(folder: &Path, args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_tenter")).args(args).current_dir(folder).output();
    let output = output.expect("tenter runs");
    assert_eq!(output.status.code(), Some(0), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// A small study without time: what it says is the same on every machine.
fn small<'a>(study: &'a str, out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let mut args = vec![study, "w1.ron", "--seconds", "0.1", "--counts-only", "--json", "--out", out];
    args.extend(["--simulators", "symplectic_euler,rk4,verlet"]);
    args.extend(more);
    args
}

/// A folder with W1, coarser so that a study of it is quick.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("a folder");
    let scene = "(target: Grid(columns: 6, rows: 6, spacing: 0.1), pins: [Particle(0), Particle(5)], \
                 mass: PerParticle(0.02), springs: (damping: 0.002), air_damping: 0.01, dt: 0.002)";
    std::fs::write(dir.path().join("w1.ron"), scene).expect("a file");
    dir
}

/// Three shards joined tell what one run does, a second run tells the same, and one cut off in the middle of a line
/// goes on from there.
fn shards_joined_are_one_run(study: &str, more: &[&str]) {
    let dir = folder();
    let folder = dir.path();
    let whole = tenter(folder, &small(study, "whole", more));
    // Error and count columns do not change from run to run.
    assert_eq!(tenter(folder, &small(study, "again", more)), whole);
    for shard in ["1/3", "2/3", "3/3"] {
        let out = format!("{study}{}", &shard[..1]);
        tenter(folder, &small(study, &out, &[more, &["--shard", shard]].concat()));
    }
    let parts = ["1", "2", "3"].map(|i| format!("{study}{i}"));
    let missing = tenter(folder, &["lab", "merge", &parts[0], &parts[1], "--out", "two", "--json"]);
    let third = std::fs::read_to_string(folder.join(&parts[2]).join(format!("{study}.3of3.jsonl")));
    // To a shard of a small study nothing may fall.
    if third.expect("a journal").lines().count() > 1 {
        assert!(!missing.contains("\"missing\":0"), "{missing}");
    }
    let joined =
        tenter(folder, &["lab", "merge", &parts[0], &parts[1], &parts[2], "--out", "joined", "--json"]);
    assert_eq!(joined, whole, "{study}");

    // A run that was killed in the middle of a line.
    let journal = folder.join("whole").join(format!("{study}.jsonl"));
    let text = std::fs::read_to_string(&journal).expect("a journal");
    let lines: Vec<&str> = text.lines().collect();
    let kept = lines.len() / 2;
    let cut = format!("{}\n{}", lines[..kept].join("\n"), &lines[kept][..lines[kept].len() / 2]);
    std::fs::write(&journal, cut).expect("a file");
    assert_eq!(tenter(folder, &small(study, "whole", more)), whole);
    let resumed = std::fs::read_to_string(&journal).expect("a journal");
    assert_eq!(resumed.lines().filter(|line| line.ends_with('}')).count(), lines.len());
}

#[test]
fn shards_of_a_trade_joined_are_one_run_that_resumes() {
    shards_joined_are_one_run("trade", &[]);
}

#[test]
fn shards_of_an_ablation_joined_are_one_run_that_resumes() {
    shards_joined_are_one_run("ablate", &["--tolerance", "0.02"]);
}

#[test]
fn shards_of_a_map_joined_are_one_run_that_resumes() {
    shards_joined_are_one_run("stability", &["--map", "damping"]);
}

#[test]
fn shards_of_an_advice_joined_are_one_run_that_resumes() {
    shards_joined_are_one_run("advise", &["--max-error", "1e-3"]);
}

/// A study that takes minutes, started and left alone until so many trials are done.
fn begun(folder: &Path, trials: usize) -> Child {
    let args = ["trade", "w1.ron", "--seconds", "0.3", "--counts-only", "--json", "--out", "long"];
    let mut command = Command::new(env!("CARGO_BIN_EXE_tenter"));
    command.args(args).args(["--simulators", "xpbd,vbd,verlet"]).current_dir(folder);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("tenter starts");
    let journal = folder.join("long/trade.jsonl");
    for _ in 0..3000 {
        let lines = std::fs::read_to_string(&journal).unwrap_or_default();
        if lines
            .lines()
            .filter(|line| line.starts_with("{\"result\"") || line.contains("\"trade\":{"))
            .count()
            >= trials
        {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    child
}

#[test]
fn ctrl_c_stops_a_study_with_what_it_has() {
    let dir = folder();
    let child = begun(dir.path(), 2);
    let told = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(told.success());
    let output = child.wait_with_output().expect("it ends");
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let table: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert!(table["rows"].as_array().expect("rows").len() >= 2 && table["missing"].as_u64() > Some(0));
    let warned = String::from_utf8(output.stderr).expect("text");
    assert!(warned.contains("interrupted: this is what there is"), "{warned}");
}

#[test]
fn what_a_killed_study_had_done_is_not_run_again() {
    let dir = folder();
    let mut child = begun(dir.path(), 3);
    child.kill().expect("killed");
    child.wait().expect("it ends");
    let journal = dir.path().join("long/trade.jsonl");
    let before = std::fs::read_to_string(&journal).expect("a journal");
    let whole = |text: &str| -> Vec<String> {
        let sound =
            |line: &&str| serde_json::from_str::<Value>(line).is_ok_and(|v| v["trial"]["trade"].is_object());
        text.lines().filter(sound).map(str::to_owned).collect()
    };
    let mut resumed = begun(dir.path(), whole(&before).len() + 2);
    resumed.kill().expect("killed");
    resumed.wait().expect("it ends");
    let after = whole(&std::fs::read_to_string(&journal).expect("a journal"));
    assert!(after.len() > whole(&before).len() && after.starts_with(&whole(&before)));
    let trials: std::collections::BTreeSet<String> = after
        .iter()
        .map(|line| serde_json::from_str::<Value>(line).expect("JSON")["trial"].to_string())
        .collect();
    assert_eq!(trials.len(), after.len(), "no trial was run twice");
}

#[test]
fn a_budget_of_time_gives_settings_that_keep_it() {
    let dir = folder();
    let args = ["advise", "w1.ron", "--seconds", "0.1", "--budget-ms", "0.5", "--json"];
    let simulators = ["--simulators", "symplectic_euler,rk4"];
    let advice: Value =
        serde_json::from_str(&tenter(dir.path(), &[&args[..], &simulators].concat())).expect("JSON");
    assert_eq!(advice["met"], true, "{advice}");
    assert_eq!(advice["quiet_seconds"], 60.0, "{advice}");
    // No claim on the time itself, which other work on this machine moves: that it was measured, and is what was asked for.
    assert!(advice["ms_per_frame"].as_f64().expect("measured") <= 0.5, "{advice}");
    assert!(advice["machine"]["processor"].is_string());
    for candidate in advice["candidates"].as_array().expect("candidates") {
        assert!(
            candidate["error"].as_f64() >= advice["error"].as_f64() || candidate["met"] == false,
            "{advice}"
        );
    }
    let tiny = ["advise", "w1.ron", "--seconds", "0.1", "--budget-ms", "1e-7", "--simulators", "rk4"];
    assert!(tenter(dir.path(), &tiny).starts_with("nothing meets this; the closest is"));
}

#[test]
fn a_map_over_damping_finds_the_limit_of_every_line() {
    let dir = folder();
    let args = ["stability", "w1.ron", "--seconds", "0.2", "--map", "damping", "--json"];
    let table: Value = serde_json::from_str(&tenter(
        dir.path(),
        &[&args[..], &["--simulators", "symplectic_euler"]].concat(),
    ))
    .expect("JSON");
    let boundaries = table["boundaries"].as_array().expect("boundaries");
    let along_dt: Vec<&Value> = boundaries.iter().filter(|b| b["along"] == "dt").collect();
    assert_eq!((along_dt.len(), boundaries.len()), (5, 6));
    for pair in along_dt.windows(2) {
        // More damping, a shorter step.
        assert!(pair[1]["at"].as_f64() > pair[0]["at"].as_f64(), "{pair:?}");
        assert!(pair[1]["theory"].as_f64() < pair[0]["theory"].as_f64(), "{pair:?}");
        assert!(pair[1]["diverged_from"].as_f64() <= pair[0]["diverged_from"].as_f64(), "{pair:?}");
    }
    let zones: Vec<&str> =
        table["map"].as_array().expect("cells").iter().filter_map(|cell| cell["zone"].as_str()).collect();
    assert!(zones.contains(&"quiet") && zones.contains(&"diverged"));
}

#[test]
fn joined_shards_name_the_machines_that_measured() {
    let dir = folder();
    let study = ["trade", "w1.ron", "--seconds", "0.05", "--simulators", "rk4", "--quiet", "--out"];
    tenter(dir.path(), &[&study[..], &["one", "--shard", "1/2"]].concat());
    tenter(dir.path(), &[&study[..], &["two", "--shard", "2/2"]].concat());
    let journal = dir.path().join("two/trade.2of2.jsonl");
    let text = std::fs::read_to_string(&journal).expect("a journal");
    let mut lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let measured = lines.iter_mut().filter(|line| line["trial"]["time"].is_object());
    let marked = measured.map(|line| line["result"]["machine"]["processor"] = "Another One".into()).count();
    assert!(marked > 0, "{text}");
    let text: Vec<String> = lines.iter().map(|line| format!("{line}\n")).collect();
    std::fs::write(&journal, text.concat()).expect("a file");
    let table = tenter(dir.path(), &["lab", "merge", "one", "two", "--out", "both", "--json"]);
    let table: Value = serde_json::from_str(&table).expect("JSON");
    assert_eq!(table["missing"], 0);
    let name = table["machine"]["processor"].as_str().expect("a machine");
    assert!(name.contains("Another One (") && name.contains(" and "), "{name}");
    for row in table["rows"].as_array().expect("rows").iter().filter(|row| row["health"] != "diverged") {
        assert!(
            row["seconds_per_simulated_second"].is_number(),
            "every row was timed by its own shard: {row}"
        );
    }
}

#[test]
fn a_terminal_sees_how_far_a_study_is() {
    let dir = folder();
    let tenter = env!("CARGO_BIN_EXE_tenter");
    let study = format!("{tenter} trade w1.ron --seconds 0.5 --counts-only --simulators rk4");
    let output = Command::new("script").args(["-qec", &study, "/dev/null"]).current_dir(dir.path()).output();
    let Ok(output) = output else {
        assert!(std::env::var_os("CI").is_none(), "script (of util-linux) is needed");
        eprintln!("skipped: a_terminal_sees_how_far_a_study_is: no script(1)");
        return;
    };
    let seen = String::from_utf8_lossy(&output.stdout);
    assert!(seen.contains(" %, trade") && seen.contains("left"), "{seen}");
}

#[test]
fn a_report_is_one_page_with_its_data_beside_it() {
    let dir = folder();
    let args = ["report", "w1.ron", "--seconds", "0.05", "--max-error", "1e-4", "--out", "page"];
    tenter(dir.path(), &[&args[..], &["--simulators", "symplectic_euler"]].concat());
    let page = std::fs::read_to_string(dir.path().join("page/report.html")).expect("a page");
    for part in ["<svg", "tenter trade w1.ron", "tenter stability", "tenter ablate", "tenter advise"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(page.contains("time: one thread at a time, interleaved, on "), "the machine is described");
    assert!(!page.contains("src=") && !page.contains("href="), "nothing is loaded from elsewhere");
    for file in ["trade.json", "trade.csv", "trade.svg", "stability.json", "ablate.json", "advise.json"] {
        assert!(dir.path().join("page").join(file).exists(), "{file}");
    }
    let table = std::fs::read_to_string(dir.path().join("page/trade.json")).expect("a table");
    let table: Value = serde_json::from_str(&table).expect("JSON");
    for row in table["rows"].as_array().expect("rows").iter().filter(|row| row["health"] != "diverged") {
        let median = row["seconds_per_simulated_second"].as_f64().expect("a time");
        let spread: Vec<f64> = serde_json::from_value(row["seconds_spread"].clone()).expect("a spread");
        assert!(spread[0] <= median && median <= spread[1], "{row}");
    }
}
