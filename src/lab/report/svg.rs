//! Diagrams as SVG, written by hand: error against work, and the map of zones.

use super::super::stability::Stability;
use super::super::trade::{Row, Trade};
use super::super::trial::Zone;
use super::escape;
use crate::scene::Precision;
use crate::simulators;
use std::collections::BTreeMap;
use std::fmt::Write;

/// Colours of methods, which stay apart on dark and on light.
const METHODS: [[u8; 3]; 12] = [
    [222, 82, 84],
    [84, 142, 214],
    [240, 138, 44],
    [70, 168, 84],
    [172, 116, 200],
    [196, 160, 32],
    [160, 118, 92],
    [52, 166, 160],
    [230, 100, 164],
    [128, 132, 232],
    [138, 158, 58],
    [40, 168, 216],
];
/// Colours of zones, which stay apart for colour-blind readers (Okabe, Ito, "Color universal design", 2008).
const ZONES: [(Zone, &str); 3] =
    [(Zone::Quiet, "#009e73"), (Zone::Unsettled, "#e69f00"), (Zone::Diverged, "#d55e00")];
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 440.0;
/// Room for labels on the left, at the top, on the right and at the bottom.
const ROOM: [f64; 4] = [70.0, 20.0, 220.0, 50.0];

/// The colour of a method, red, green and blue: by its place in the registry, so the same in every run and every diagram.
pub fn method_colour(simulator: &str) -> [u8; 3] {
    let place = simulators::ALL.iter().position(|entry| entry.id == simulator).unwrap_or(0);
    METHODS[place % METHODS.len()]
}

/// A logarithmic plane with its picture.
struct Plane {
    x: [f64; 2],
    y: [f64; 2],
    text: String,
}

impl Plane {
    /// The plane that holds these points, with a quarter of a decade around them; none where there are none.
    fn around(points: &[(f64, f64)], labels: [&str; 2]) -> Option<Self> {
        let range = |values: Vec<f64>| {
            let logs = values.into_iter().filter(|v| *v > 0.0 && v.is_finite()).map(f64::log10);
            let (low, high) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            (low <= high).then_some([low - 0.25, high + 0.25])
        };
        let x = range(points.iter().map(|p| p.0).collect())?;
        let y = range(points.iter().map(|p| p.1).collect())?;
        let mut plane = Self { x, y, text: String::new() };
        let _ = write!(
            plane.text,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"11\">\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>"
        );
        let (bottom, right) = (HEIGHT - ROOM[3], WIDTH - ROOM[2]);
        for exponent in (x[0].ceil() as i32)..=(x[1].floor() as i32) {
            let at = plane.across(10f64.powi(exponent));
            plane.line([at, ROOM[1], at, bottom], "#ddd", 1.0);
            plane.label([at, bottom + 15.0], "middle", &format!("1e{exponent}"));
        }
        for exponent in (y[0].ceil() as i32)..=(y[1].floor() as i32) {
            let at = plane.down(10f64.powi(exponent));
            plane.line([ROOM[0], at, right, at], "#ddd", 1.0);
            plane.label([ROOM[0] - 6.0, at + 4.0], "end", &format!("1e{exponent}"));
        }
        plane.label([f64::midpoint(ROOM[0], right), HEIGHT - 12.0], "middle", labels[0]);
        plane.label([ROOM[0], ROOM[1] - 6.0], "start", labels[1]);
        Some(plane)
    }

    fn across(&self, value: f64) -> f64 {
        ROOM[0] + (value.log10() - self.x[0]) / (self.x[1] - self.x[0]) * (WIDTH - ROOM[0] - ROOM[2])
    }

    fn down(&self, value: f64) -> f64 {
        HEIGHT
            - ROOM[3]
            - (value.log10() - self.y[0]) / (self.y[1] - self.y[0]) * (HEIGHT - ROOM[1] - ROOM[3])
    }

    fn line(&mut self, [x1, y1, x2, y2]: [f64; 4], colour: &str, width: f64) {
        let _ = write!(
            self.text,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"{colour}\" stroke-width=\"{width}\"/>"
        );
    }

    fn label(&mut self, [x, y]: [f64; 2], anchor: &str, text: &str) {
        let text = escape(text);
        let _ = write!(self.text, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{text}</text>");
    }

    fn mark(&mut self, [x, y]: [f64; 2], radius: f64, colour: &str, filled: bool, hover: &str) {
        let fill = if filled { colour } else { "#fff" };
        let _ = write!(
            self.text,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\"><title>{}</title></circle>",
            escape(hover)
        );
    }

    fn legend(&mut self, place: usize, colour: &str, filled: bool, name: &str) {
        let (x, y) = (WIDTH - ROOM[2] + 20.0, ROOM[1] + 10.0 + 17.0 * place as f64);
        self.mark([x, y], 4.0, colour, filled, name);
        self.label([x + 10.0, y + 4.0], "start", name);
    }

    fn finish(self) -> String {
        self.text + "</svg>"
    }
}

/// Error against work, both logarithmic: a colour for each method, a line for each of its settings, small marks in Single,
/// the Pareto front drawn thick, hollow marks for another model, crosses at the upper edge for runs that burst. Empty where
/// there is nothing to draw.
pub fn trade(table: &Trade) -> String {
    let told = |row: &Row| row.relative_error.filter(|e| *e > 0.0).map(|e| (row.spring_visits, e));
    let mut points: Vec<(f64, f64)> = table.rows.iter().filter_map(told).collect();
    let highest = points.iter().map(|p| p.1).fold(1.0, f64::max);
    let is_burst = |row: &&Row| row.health == Zone::Diverged;
    points.extend(table.rows.iter().filter(is_burst).map(|r| (r.spring_visits, highest)));
    let labels = ["springs looked at for each simulated second", "RMS error over RMS displacement"];
    let Some(mut plane) = Plane::around(&points, labels) else { return String::new() };
    let mut place = 0;
    for entry in simulators::ALL {
        let own = |row: &&Row| row.settings.simulator == entry.id;
        let Some(first) = table.rows.iter().find(own) else { continue };
        let [r, g, b] = method_colour(entry.id);
        let colour = format!("#{r:02x}{g:02x}{b:02x}");
        let mut before: BTreeMap<String, [f64; 2]> = BTreeMap::new();
        for row in table.rows.iter().filter(own) {
            let name = row.settings.label();
            let hover = format!("{name}, dt {} s, {:?}", row.settings.dt, row.health);
            if let Some((x, y)) = told(row) {
                let at = [plane.across(x), plane.down(y)];
                let radius = if row.settings.precision == Precision::Single { 2.0 } else { 4.0 };
                plane.mark(at, radius, &colour, row.same_model, &hover);
                if let Some([x, y]) = before.insert(name, at) {
                    plane.line([x, y, at[0], at[1]], &colour, 1.0);
                }
            } else if row.health == Zone::Diverged {
                let [x, y] = [plane.across(row.spring_visits), plane.down(highest)];
                plane.line([x - 4.0, y - 4.0, x + 4.0, y + 4.0], &colour, 2.0);
                plane.line([x - 4.0, y + 4.0, x + 4.0, y - 4.0], &colour, 2.0);
            }
        }
        plane.legend(place, &colour, first.same_model, entry.id);
        place += 1;
    }
    let below = ROOM[1] + 22.0 + 17.0 * place as f64;
    for (i, text) in
        ["small: Single", "hollow: another model", "thick: nothing beats these"].into_iter().enumerate()
    {
        plane.label([WIDTH - ROOM[2] + 16.0, below + 15.0 * i as f64], "start", text);
    }
    let mut front: Vec<(f64, f64)> = table.rows.iter().filter(|row| row.pareto).filter_map(told).collect();
    front.sort_by(|a, b| a.0.total_cmp(&b.0));
    for ends in front.windows(2) {
        let [a, b] = [ends[0], ends[1]];
        let corners = [plane.across(a.0), plane.down(a.1), plane.across(b.0), plane.down(b.1)];
        plane.line(corners, "#000000", 2.5);
    }
    plane.finish()
}

/// The map of a method: dt against stiffness, green quiet, orange unsettled, red diverged; the limit in theory drawn over.
/// Empty where nothing was mapped.
pub fn map(table: &Stability, simulator: &str) -> String {
    let cells = || table.map.iter().filter(|cell| cell.simulator == simulator);
    let points: Vec<(f64, f64)> = cells().map(|cell| (cell.stiffness, cell.dt)).collect();
    let Some(mut plane) = Plane::around(&points, ["stiffness of the stretch springs, N/m", "dt, s"]) else {
        return String::new();
    };
    let colour = |zone| ZONES.iter().find(|(other, _)| *other == zone).map_or("#000", |(_, colour)| colour);
    for cell in cells() {
        let at = [plane.across(cell.stiffness), plane.down(cell.dt)];
        plane.mark(
            at,
            4.0,
            colour(cell.zone),
            true,
            &format!("k {}, dt {}: {:?}", cell.stiffness, cell.dt, cell.zone),
        );
    }
    let theory = table.boundaries.iter().filter(|b| b.simulator == simulator && b.along == "dt");
    let theory: Vec<[f64; 2]> = theory
        .filter_map(|b| b.theory.filter(|t| *t > 0.0).map(|t| [plane.across(b.at), plane.down(t)]))
        .collect();
    for ends in theory.windows(2) {
        plane.line([ends[0][0], ends[0][1], ends[1][0], ends[1][1]], "#000000", 2.0);
    }
    for (place, (zone, colour)) in ZONES.into_iter().enumerate() {
        plane.legend(place, colour, true, super::zone(zone));
    }
    plane.label([WIDTH - ROOM[2] + 16.0, ROOM[1] + 68.0], "start", "line: limit in theory");
    plane.finish()
}
