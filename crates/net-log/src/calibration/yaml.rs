//! What is wrong with a YAML text, in plain words.

use serde::de::DeserializeOwned;

use crate::calibration::wrong;
use crate::error::Result;

/// Longest piece of a line that is shown, characters.
const LONGEST: usize = 60;

/// Reads the fields of a calibration of this kind. An error names the file, the line, the field in it and what was expected.
pub(super) fn read<T: DeserializeOwned>(place: &str, text: &str, kind: &str) -> Result<T> {
    serde_saphyr::from_str(text).map_err(|error| {
        let cause = error.without_snippet();
        let expected = expected(cause, kind);
        let why = expected
            .clone()
            .unwrap_or_else(|| format!("{kind}; {}", cause.render_with_formatter(&serde_saphyr::UserMessageFormatter)));
        let Some(at) = error.location().and_then(|l| usize::try_from(l.line()).ok()).filter(|&line| line > 0) else {
            return wrong(place, "YAML", "unreadable", &why);
        };
        let line = text.lines().nth(at - 1).unwrap_or("").trim();
        let shown: String = line.chars().take(LONGEST).collect();
        let rest = if shown.len() < line.len() { "..." } else { "" };
        // What is no YAML is of no field.
        let field =
            expected.and_then(|_| field_of(text, at)).map_or_else(String::new, |name| format!(", field {name}"));
        wrong(place, "YAML", format!("unreadable in line {at}{field} ({shown}{rest})"), &why)
    })
}

/// What would have been accepted where a field holds something else; `None` for what is no YAML.
fn expected(error: &serde_saphyr::Error, kind: &str) -> Option<String> {
    use serde_saphyr::Error::{DuplicateMappingKey, InvalidScalar, Unexpected};
    Some(match error {
        InvalidScalar { ty, .. } if ty.starts_with(['u', 'i']) => "a whole number, not below zero".to_owned(),
        InvalidScalar { ty, .. } if ty.contains("float") => "a number".to_owned(),
        Unexpected { expected, .. } if expected.contains("sequence") => "a list of numbers, [1, 2, 3]".to_owned(),
        Unexpected { expected, .. } if expected.contains("mapping") => format!("fields of {kind}, name: value"),
        Unexpected { expected, .. } if expected.contains("scalar") => "a single word or number".to_owned(),
        DuplicateMappingKey { .. } => "this field once, not again".to_owned(),
        _ => return None,
    })
}

/// The name of the field that line `at`, counted from 1, belongs to, after the names of those that it is part of.
fn field_of(text: &str, at: usize) -> Option<String> {
    let lines: Vec<&str> = text.lines().take(at).collect();
    let mut names = Vec::new();
    let mut indent = usize::MAX;
    for line in lines.iter().rev() {
        let trimmed = line.trim_start();
        let Some((name, _)) = trimmed.split_once(':') else { continue };
        let is_name = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
        let its_indent = line.len() - trimmed.len();
        if is_name && its_indent < indent {
            names.push(name);
            indent = its_indent;
        }
    }
    names.reverse();
    (!names.is_empty()).then(|| names.join("."))
}
