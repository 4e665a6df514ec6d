//! Names from a file as names of Rust.

use std::collections::HashSet;

/// Words that cannot be the name of a field.
const KEYWORDS: [&str; 52] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate",
    "do", "dyn", "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl",
    "in", "let", "loop", "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref",
    "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "typeof",
    "unsafe", "unsized", "use", "virtual", "where", "while", "yield", "union",
];

/// Names of fields, each once.
pub(super) struct Names(Vec<String>);

impl Names {
    pub fn new<'a>(names: impl Iterator<Item = &'a str>) -> Self {
        let mut taken = HashSet::new();
        let fields = names.map(|name| {
            let mut field: String = { name.chars() }
                .map(|c| {
                    if c.is_ascii_alphanumeric() {
                        c.to_ascii_lowercase()
                    } else {
                        '_'
                    }
                })
                .collect();
            let begins = field.starts_with(|c: char| c.is_ascii_lowercase());
            if !begins || KEYWORDS.contains(&&*field) {
                field = format!("p_{field}");
            }
            while !taken.insert(field.clone()) {
                field.push('_');
            }
            field
        });
        Self(fields.collect())
    }

    pub fn at(&self, i: usize) -> &str {
        &self.0[i]
    }
}

/// Types that the printed source has from elsewhere.
const TYPES: [&str; 10] = [
    "Bivariate",
    "Default",
    "Dynamics",
    "Elementary",
    "Embedding",
    "Number",
    "Option",
    "SMatrix",
    "SVector",
    "Self",
];

/// The name of a type: "cart-pole" becomes CartPole, "number" PlantNumber.
pub(crate) fn type_name(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric());
    let camel: String = words
        .flat_map(|word| {
            let mut letters = word.chars();
            let first = letters.next().map(|c| c.to_ascii_uppercase());
            first.into_iter().chain(letters)
        })
        .collect();
    let begins = camel.starts_with(|c: char| c.is_ascii_uppercase());
    if begins && !TYPES.contains(&&*camel) {
        camel
    } else {
        format!("Plant{camel}")
    }
}

/// A name or unit as code in a comment, without what has a meaning there.
pub(crate) fn text(name: &str) -> String {
    let kept: String = { name.chars() }
        .map(|c| {
            let plain =
                c.is_ascii_graphic() || c == ' ' || c.is_alphanumeric() || "°·²³⁻¹".contains(c);
            if plain && !"`|".contains(c) { c } else { '_' }
        })
        .collect();
    if kept.trim().is_empty() {
        "no unit".to_owned()
    } else {
        format!("`{kept}`")
    }
}
