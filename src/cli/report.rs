//! `tenter report`: all studies of a scene as one page, with the data beside it.

use super::study::{Study, positive};
use super::{Ending, ablate, advise, output, stability, trade};
use crate::lab::journal::write_whole;
use crate::lab::report::{self, Figure};
use crate::scene::Refusal;
use clap::Args;

#[derive(Args, Clone)]
pub struct Options {
    #[command(flatten)]
    study: Study,
    /// RMS position error that the advice keeps, m; a thousandth of the motion where left out.
    #[arg(long, value_name = "E", value_parser = positive)]
    max_error: Option<f64>,
}

pub fn report(options: &Options) -> Result<Ending, Refusal> {
    let study = &options.study;
    let Some(folder) = study.out.clone() else {
        return Err(Refusal::new("report: needs a folder; accepted: --out DIR"));
    };
    let case = study.case()?;
    let mut quietly = study.clone();
    (quietly.common.json, quietly.common.quiet) = (false, true);
    let mut figures = Vec::new();
    let again = |command: &[String]| format!("tenter {} --out DIR", command.join(" "));

    let own = trade::Options { study: quietly.clone() };
    let table = own.find(&case)?;
    let found = trade::found(&table);
    quietly.tell("trade", &found)?;
    figures.push(Figure {
        title: "Speed against accuracy".to_owned(),
        table: found.text,
        diagram: found.diagrams.into_iter().map(|(_, svg)| svg).collect(),
        command: again(&own.command()),
    });

    let own = stability::Options { study: quietly.clone(), map: "stiffness".to_owned() };
    let limits = own.find(&case)?;
    let found = stability::found(&limits, &study.simulators)?;
    quietly.tell("stability", &found)?;
    let maps = found.diagrams.into_iter().filter(|(_, svg)| !svg.is_empty());
    let maps: Vec<_> = maps
        .flat_map(|(name, svg)| ["<h3>".to_owned(), report::escape(&name), "</h3>".to_owned(), svg])
        .collect();
    figures.push(Figure {
        title: "Stability".to_owned(),
        table: found.text,
        diagram: maps.concat(),
        command: again(&own.command()),
    });

    let own = ablate::Options { study: quietly.clone(), tolerance: 0.01 };
    let (text, command) = (own.find(&case), again(&own.command()));
    // A scene that bursts as it stands has no ablation, but everything else of the report.
    let table_text = match &text {
        Ok(table) => {
            let found = ablate::found(table);
            quietly.tell("ablate", &found)?;
            found.text
        }
        Err(refusal) => refusal.to_string(),
    };
    figures.push(Figure {
        title: "What the scene requires".to_owned(),
        table: table_text,
        diagram: String::new(),
        command,
    });

    let motion = table.reference.as_ref().map_or(1.0, |r| r.displacement);
    let max_error = Some(options.max_error.unwrap_or(motion / 1000.0)).filter(|e| *e > 0.0);
    let own = advise::Options { study: quietly.clone(), max_error, budget_ms: None };
    let text = match own.find(&case) {
        Ok(advice) => {
            let found = advise::found(&advice);
            quietly.tell("advise", &found)?;
            found.text
        }
        Err(refusal) => refusal.to_string(),
    };
    figures.push(Figure {
        title: "Advice".to_owned(),
        table: text,
        diagram: String::new(),
        command: again(&own.command()),
    });

    let page = folder.join("report.html");
    write_whole(&page, report::html(&format!("Tenter: {}", study.scene), &figures).as_bytes())?;
    if study.common.json {
        output::print(&output::json(&serde_json::json!({ "report": page }))?);
    }
    study.common.say(&format!("{}", page.display()));
    Ok(Ending::Done)
}
