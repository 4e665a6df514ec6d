//! The paper's claims as a table.

use crate::table::{Table, short};
use ballbot_studies::reproduction::{Claim, Published, Source};

/// How many claims of each source agree, in words.
pub fn counts(claims: &[Claim]) -> String {
    let [printed, derived, own] = Source::ALL.map(|source| {
        let of_source = || claims.iter().filter(|claim| claim.source == source);
        let agreeing = of_source().filter(|claim| claim.agrees()).count();
        format!("{agreeing} of {}", of_source().count())
    });
    format!(
        "{printed} numbers that the paper prints agree, {derived} statements derived from its words \
         (with a number, a tolerance or a starting point of ours), and {own} checks of our own"
    )
}

/// The cells of its line.
pub fn cells(claim: &Claim) -> [String; 7] {
    let (published, tolerance) = match claim.published {
        Published::Value { value, tolerance } => (short(value), format!("± {tolerance}")),
        Published::AtMost(limit) => (format!("<= {}", short(limit)), "limit".to_owned()),
        Published::AtLeast(limit) => (format!(">= {}", short(limit)), "limit".to_owned()),
    };
    let verdict = if claim.agrees() { "agrees" } else { "DIFFERS" };
    [
        format!("{}: {}", claim.place, claim.quantity),
        claim.source.name().to_owned(),
        published,
        short(claim.computed),
        format!("{:+.1e}", claim.difference()),
        tolerance,
        verdict.to_owned(),
    ]
}

/// The headers over [`cells`].
pub const HEADERS: [&str; 7] = [
    "the paper's",
    "source",
    "to be met",
    "computed",
    "difference",
    "tolerance",
    "verdict",
];

/// The claims as a table for the screen.
pub fn table(claims: &[Claim]) -> String {
    let mut table = Table::new(HEADERS);
    for claim in claims {
        table.row(cells(claim));
    }
    table.to_string()
}
