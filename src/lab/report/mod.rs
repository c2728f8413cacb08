//! What the studies found, for people and programs: tables as text, CSV, the diagrams as SVG, and one HTML page that
//! needs nothing beside it.

mod svg;

use super::ablation::Ablation;
use super::advice::Advice;
use super::stability::Stability;
use super::timing::Machine;
use super::trade::{Row, Trade};
use super::trial::Zone;
use crate::scene::Precision;
use std::fmt::Write;

pub use svg::{map, method_colour, trade as trade_diagram};

/// A number for a table, or a dash.
fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.3e}"))
}

fn seconds(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:.6}"))
}

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{:.1} %", 100.0 * value))
}

fn zone(zone: Zone) -> &'static str {
    match zone {
        Zone::Quiet => "quiet",
        Zone::Unsettled => "unsettled",
        Zone::Diverged => "diverged",
    }
}

fn incomplete(missing: usize) -> String {
    if missing > 0 { format!("incomplete: {missing} parts are missing\n") } else { String::new() }
}

fn machine(machine: Option<&Machine>, order: &str) -> String {
    machine.map_or_else(
        || "time: not measured; trials ran in parallel\n".to_owned(),
        |m| {
            format!(
                "time: one thread at a time, {order}, on {}, {} threads, {}, tenter {}; the other trials ran in parallel\n",
                m.processor, m.threads, m.system, m.tenter
            )
        },
    )
}

/// The trade as a table.
pub fn trade(table: &Trade) -> String {
    let mut text = String::new();
    if let Some(reference) = &table.reference {
        let _ = writeln!(
            text,
            "reference: {} at dt {:.3e} s, uncertain by {:.1e} m; {} is {:.1e} m off; trajectories compare up to {} s",
            reference.method,
            reference.dt,
            reference.uncertainty,
            reference.second_method,
            reference.second_distance,
            reference.valid_until
        );
        let _ = writeln!(
            text,
            "its largest strain {:.4}, mean strain at the end {:.4}; two starts 1e-8 m apart grow apart {:.1} times",
            reference.max_strain, reference.mean_strain, reference.growth
        );
    }
    let _ = writeln!(
        text,
        "{:36} {:>10} {:>10} {:>10} {:>10} {:>10} {:>9} {:>9} {:>10} {:>10} {:>21}  health",
        "method",
        "dt s",
        "rms m",
        "max m",
        "relative",
        "at rest m",
        "drift",
        "strain",
        "forces/s",
        "visits/s",
        "s/s (fastest, slowest)",
    );
    for row in &table.rows {
        let told = |error| if row.below_reference { "<ref".to_owned() } else { number(error) };
        let time = row.seconds_per_simulated_second.zip(row.seconds_spread);
        let time = time.map_or_else(|| "-".to_owned(), |(t, [a, b])| format!("{t:.2e} ({a:.2e}, {b:.2e})"));
        let limit = row.limit_error.map_or_else(String::new, |e| format!(", {e:.2e} off its own limit"));
        let model = if row.same_model { String::new() } else { format!(", another model{limit}") };
        let health = if row.capped { "given up" } else { zone(row.health) };
        let pareto = if row.pareto { ", best of its work" } else { "" };
        let _ = writeln!(
            text,
            "{:36} {:>10.3e} {:>10} {:>10} {:>10} {:>10} {:>9} {:>9} {:>10.3e} {:>10.3e} {:>21}  {health}{model}{pareto}",
            row.settings.label(),
            row.settings.dt,
            told(row.rms_error),
            told(row.max_error),
            told(row.relative_error),
            number(row.equilibrium_error),
            number(row.energy_drift).replace(".000", ""),
            number(row.max_strain),
            row.force_evaluations,
            row.spring_visits,
            time
        );
    }
    for order in &table.orders {
        let observed = order.told();
        let flag = if order.flagged { "  (off by more than 0.2)" } else { "" };
        let words: Vec<_> = order.params.iter().map(|(name, value)| format!(" {name}={value}")).collect();
        let name = format!("{}{}", order.simulator, words.concat());
        let _ = writeln!(text, "order of {name}: {observed}, declared {}{flag}", order.declared);
    }
    text += &statistics(table);
    if table.rows.iter().any(|row| row.capped) {
        text +=
            "given up: its work passed the cap (so many springs looked at, not time), so it has no errors.\n";
    }
    text += &another_model(table);
    text += &cheapest(table);
    text + &machine(table.machine.as_ref(), "interleaved") + &incomplete(table.missing)
}

/// What to choose for an error: the rows of the scene's model with the least work within each of some.
fn cheapest(table: &Trade) -> String {
    let mut text = String::new();
    if table.rows.iter().all(|row| row.relative_error.is_none()) {
        return text;
    }
    for percent in [10.0, 1.0, 0.1] {
        let is_near = |row: &&Row| row.relative_error.is_some_and(|error| 100.0 * error <= percent);
        let near =
            table.rows.iter().filter(|row| row.same_model && row.health == Zone::Quiet).filter(is_near);
        let best = near.min_by(|a, b| a.spring_visits.total_cmp(&b.spring_visits));
        let told = best.map_or("none of these".to_owned(), |row| {
            let (name, dt, work) = (row.settings.label(), row.settings.dt, row.spring_visits);
            format!("{name} at dt {dt:.3e} s, {work:.3e} springs looked at a simulated second")
        });
        let _ = writeln!(text, "cheapest within {percent} % of the motion: {told}");
    }
    text
}

/// How far the statistics of every run are from the reference's: all there is to compare once trajectories part.
fn statistics(table: &Trade) -> String {
    let Some(reference) = &table.reference else { return String::new() };
    let own = &reference.statistics;
    let period = own.period.map_or_else(|| "none".to_owned(), |period| format!("{period:.4} s"));
    let strain: Vec<_> = own
        .strain
        .iter()
        .map(|s| format!("{} {:.4} mean, {:.4} largest", s.kind, s.mean, s.largest))
        .collect();
    let mut text = format!(
        "statistics of the reference: energies {:.4e} kinetic, {:.4e} gravitational, {:.4e} elastic J; period {period}; strain: {}\n\
         {:36} {:>10} {:>10} {:>10} {:>10} {:>11} {:>14}\n",
        own.energy[0],
        own.energy[1],
        own.energy[2],
        strain.join("; "),
        "off by",
        "dt s",
        "energy",
        "centre m",
        "period",
        "mean strain",
        "largest strain"
    );
    for row in &table.rows {
        let Some(apart) = row.statistics.as_ref().map(|s| s.apart(own)) else { continue };
        let _ = writeln!(
            text,
            "{:36} {:>10.3e} {:>10.2e} {:>10.2e} {:>10} {:>11.2e} {:>14.2e}",
            row.settings.label(),
            row.settings.dt,
            apart.energy,
            apart.centre,
            apart.period.map_or_else(|| "-".to_owned(), |p| format!("{p:.2e}")),
            apart.strain[0],
            apart.strain[1]
        );
    }
    text
}

/// What methods that solve another model do with dt and sweeps, with the figures of this scene.
fn another_model(table: &Trade) -> String {
    let told = |row: &&Row| {
        !row.same_model && row.settings.precision == Precision::Double && row.max_strain.is_some()
    };
    let rows: Vec<&Row> = table.rows.iter().filter(told).collect();
    let Some(coarsest) = rows.iter().rev().max_by(|a, b| a.settings.dt.total_cmp(&b.settings.dt)) else {
        return String::new();
    };
    let strain = |row: &Row| number(row.max_strain);
    let along_effort = rows.iter().filter(|row| row.settings.dt == coarsest.settings.dt);
    let along_effort: Vec<_> =
        along_effort.map(|row| format!("{} at {}", strain(row), row.settings.label())).collect();
    let along_dt = rows.iter().filter(|row| row.settings.params == coarsest.settings.params);
    let along_dt: Vec<_> =
        along_dt.map(|row| format!("{} at dt {:.3e} s", strain(row), row.settings.dt)).collect();
    format!(
        "another model: springs are taken as rigid constraints; as dt goes to 0 the cloth does not approach the springs. How \
         stiff it looks is a matter of dt and sweeps, not of stiffness. Its largest strain here, dt {:.3e} s: {}; {}: {}.\n",
        coarsest.settings.dt,
        along_effort.join(", "),
        coarsest.settings.label(),
        along_dt.join(", ")
    )
}

/// The trade as CSV.
pub fn trade_csv(table: &Trade) -> String {
    let mut text = "simulator,params,precision,dt,rms_error,max_error,relative_error,below_reference,equilibrium_error,\
                    limit_error,energy_drift,max_strain,force_evaluations,spring_visits,seconds_per_simulated_second,\
                    fastest,slowest,same_model,health,pareto,capped,\
                    kinetic,gravitational,elastic,centre_x,centre_y,centre_z,period,mean_stretch,largest_stretch,\
                    mean_shear,largest_shear,mean_bend,largest_bend\n"
        .to_owned();
    let cell = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:?}"));
    for row in &table.rows {
        let params: Vec<_> = row.settings.params.iter().map(|(k, v)| format!("{k}={v}")).collect();
        let cells = [
            row.settings.simulator.clone(),
            params.join(";"),
            format!("{:?}", row.settings.precision),
            cell(Some(row.settings.dt)),
            cell(row.rms_error),
            cell(row.max_error),
            cell(row.relative_error),
            row.below_reference.to_string(),
            cell(row.equilibrium_error),
            cell(row.limit_error),
            cell(row.energy_drift),
            cell(row.max_strain),
            cell(Some(row.force_evaluations)),
            cell(Some(row.spring_visits)),
            cell(row.seconds_per_simulated_second),
            cell(row.seconds_spread.map(|s| s[0])),
            cell(row.seconds_spread.map(|s| s[1])),
            row.same_model.to_string(),
            zone(row.health).to_owned(),
            row.pareto.to_string(),
            row.capped.to_string(),
        ];
        text += &cells.join(",");
        let statistics = row.statistics.as_ref();
        let strain = |kind: &str| statistics?.strain.iter().find(|s| s.kind == kind);
        let strains = ["stretch", "shear", "bend"].map(|kind| strain(kind).map(|s| [s.mean, s.largest]));
        let numbers = (0..3).map(|i| statistics.map(|s| s.energy[i]));
        let numbers = numbers.chain((0..3).map(|i| statistics.map(|s| s.centre[i])));
        let numbers = numbers.chain([statistics.and_then(|s| s.period)]);
        let numbers = numbers.chain(strains.into_iter().flat_map(|s| [s.map(|s| s[0]), s.map(|s| s[1])]));
        numbers.for_each(|number| text += &format!(",{}", cell(number)));
        text.push('\n');
    }
    text
}

/// The stability study as tables.
pub fn stability(table: &Stability) -> String {
    let mut text = format!(
        "fastest motion: {:.3} rad/s in this shape, at most {:.3} rad/s in any\n{:18} {:>12} {:>12} {:>12}\n",
        table.omega_max, table.omega_bound, "longest dt, s", "theory", "measured", "guaranteed"
    );
    for limit in &table.limits {
        let _ = writeln!(
            text,
            "{:18} {:>12} {:>12} {:>12}",
            limit.simulator,
            seconds(limit.dt_theory),
            seconds(limit.dt_measured),
            seconds(limit.dt_guaranteed)
        );
    }
    for b in &table.boundaries {
        let _ = writeln!(
            text,
            "{:18} along {} at {}: quiet until {}, diverged from {}{}",
            b.simulator,
            b.along,
            b.at,
            seconds(b.quiet_until),
            seconds(b.diverged_from),
            b.theory.map_or_else(String::new, |t| format!(" (theory {t:.6})"))
        );
    }
    text + &incomplete(table.missing)
}

/// The map as CSV.
pub fn stability_csv(table: &Stability) -> String {
    let mut text = "simulator,dt,stiffness,damping,zone\n".to_owned();
    for cell in &table.map {
        let (dt, stiffness, damping) = (cell.dt, cell.stiffness, cell.damping);
        let _ = writeln!(text, "{},{dt:?},{stiffness:?},{damping:?},{}", cell.simulator, zone(cell.zone));
    }
    text
}

/// The ablation as a table.
pub fn ablation(table: &Ablation) -> String {
    let mut text = format!(
        "{:18} {:>12} {:>12} {:>12}  verdict at {} of the motion\n",
        "left out", "change", "work saved", "time saved", table.tolerance
    );
    for row in &table.rows {
        let _ = writeln!(
            text,
            "{:18} {:>12} {:>12} {:>12}  {}",
            row.ingredient,
            number(row.change),
            percent(Some(row.work_saved)),
            percent(row.time_saved),
            row.verdict()
        );
    }
    if !table.resolution_tried {
        text += "a lower resolution was not tried: only a grid from its beginning can be made coarser here; import a coarser mesh\n";
    }
    text += &table.proposal.as_ref().map_or_else(
        || "nothing can be left out\n".to_owned(),
        |p| {
            format!(
                "leave out {} together: run so, it changes {:.3e}, saves {} of the work and {} of the time\n",
                p.leave_out.join(", "),
                p.change,
                percent(Some(p.work_saved)),
                percent(p.time_saved)
            )
        },
    );
    text + &machine(table.machine.as_ref(), "interleaved") + &incomplete(table.missing)
}

/// The ablation as CSV.
pub fn ablation_csv(table: &Ablation) -> String {
    let mut text = "ingredient,change,work_saved,time_saved,needed,health\n".to_owned();
    let cell = |value: Option<f64>| value.map_or_else(String::new, |value| format!("{value:?}"));
    for row in &table.rows {
        let (change, time) = (cell(row.change), cell(row.time_saved));
        let _ = writeln!(
            text,
            "{},{change},{:?},{time},{},{}",
            row.ingredient,
            row.work_saved,
            row.needed,
            zone(row.health)
        );
    }
    text
}

/// The advice in words.
pub fn advice(advice: &Advice) -> String {
    let error = |error: Option<f64>| match error {
        Some(error) if error < advice.told_from => format!("under {:.1e}", advice.told_from),
        _ => number(error),
    };
    let mut text = if advice.met { String::new() } else { "nothing meets this; the closest is\n".to_owned() };
    let _ = writeln!(
        text,
        "{} at dt {:.6} s: error {} m, {} springs looked at a simulated second{}",
        advice.settings.label(),
        advice.settings.dt,
        error(advice.error),
        number(Some(advice.spring_visits)),
        advice.ms_per_frame.map_or_else(String::new, |ms| format!(", {ms:.4} ms a frame"))
    );
    if advice.candidates.is_empty() {
        return "no method was tried here: other shards have them\n".to_owned() + &incomplete(advice.missing);
    }
    let margin =
        advice.stability_margin.map_or_else(|| "no limit".to_owned(), |m| format!("{m:.2} times dt"));
    let _ = writeln!(
        text,
        "limit of stability: {margin}; seen quiet for {} simulated seconds; {} runs in all\nthe best of each method:",
        advice.quiet_seconds, advice.trials
    );
    for c in &advice.candidates {
        let _ = writeln!(
            text,
            "  {:36} dt {:.3e} s  error {} m  visits/s {:.3e}{}  {}",
            c.settings.label(),
            c.settings.dt,
            error(c.error),
            c.spring_visits,
            c.ms_per_frame.map_or_else(String::new, |ms| format!("  {ms:.3} ms a frame")),
            if c.met { "meets it" } else { "does not meet it" }
        );
    }
    text + &machine(advice.machine.as_ref(), "one method after the other") + &incomplete(advice.missing)
}

/// One figure of a page: what it shows, and the command that makes it again.
pub struct Figure {
    /// Its heading.
    pub title: String,
    /// Text in a fixed pitch.
    pub table: String,
    /// A diagram; empty where there is none.
    pub diagram: String,
    /// The command that makes these numbers again.
    pub command: String,
}

/// Text that stands in HTML or SVG as itself.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The page: everything in one file.
pub fn html(title: &str, figures: &[Figure]) -> String {
    let mut page = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title>\
         <style>body{{font:16px/1.5 sans-serif;max-width:75em;margin:2em auto;padding:0 1em;color:#222}}\
         pre{{overflow-x:auto;font-size:12px;background:#f6f6f6;padding:1em}}code{{background:#eee;padding:.2em .4em}}\
         svg{{max-width:100%;height:auto}}</style><h1>{0}</h1>",
        escape(title)
    );
    for figure in figures {
        let _ = write!(
            page,
            "<h2>{}</h2>{}<pre>{}</pre><p>Again: <code>{}</code></p>",
            escape(&figure.title),
            figure.diagram,
            escape(&figure.table),
            escape(&figure.command)
        );
    }
    page + "</html>\n"
}
