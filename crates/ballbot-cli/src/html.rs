//! Reports: self-contained HTML pages of text, tables and figures.

use lpvmpc_figures::{Figure, FigureError};

/// A figure with its file name and caption.
#[derive(Debug)]
pub struct CaptionedFigure {
    /// File name without extension.
    pub name: &'static str,
    /// One or two sentences under it.
    pub caption: String,
    /// The figure.
    pub figure: Figure,
}

const STYLE: &str = "
:root { color-scheme: light; }
body { margin: 0; font: 16px/1.5 system-ui, sans-serif; color: #1b1f24; background: #fff; }
main { max-width: 60rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #d0d7de; }
figure { margin: 2rem 0; } figure svg { display: block; margin: 0 auto; max-width: 100%; height: auto; }
figcaption { font-size: .92rem; color: #444c56; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #e4e8ec; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; white-space: normal; min-width: 7rem; }
th { border-bottom: 2px solid #8c959f; white-space: normal; vertical-align: bottom; }
.differs { color: #b3261e; font-weight: 600; } .agrees { color: #1a7f37; }
pre { white-space: pre-wrap; background: #f6f8fa; padding: .8rem 1rem; border-radius: 6px; }
";

/// A whole page; `body` is HTML.
pub fn page(title: &str, body: &str) -> String {
    let title = escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
         <main>\n<h1>{title}</h1>\n{body}</main>\n</body>\n</html>\n"
    )
}

/// The figures, inline, with their captions.
///
/// # Errors
/// A figure cannot be drawn.
pub fn figures(figures: &[CaptionedFigure]) -> Result<String, FigureError> {
    let mut html = String::new();
    for figure in figures {
        html += &format!(
            "<figure id=\"{}\">{}<figcaption>{}</figcaption></figure>\n",
            figure.name,
            figure.figure.svg()?,
            escape(&figure.caption)
        );
    }
    Ok(html)
}

/// Text as HTML shows it.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// A table of texts, which may be wider than the page.
pub fn table(headers: &[String], rows: &[Vec<String>]) -> String {
    let line = |cells: &[String], tag: &str| {
        let cells = cells.iter().map(|cell| {
            let class = match cell.as_str() {
                "agrees" => " class=\"agrees\"",
                "DIFFERS" => " class=\"differs\"",
                _ => "",
            };
            format!("<{tag}{class}>{}</{tag}>", escape(cell))
        });
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let rows: String = rows.iter().map(|row| line(row, "td")).collect();
    format!(
        "<div class=\"scroll\"><table>\n<thead>{}</thead>\n<tbody>\n{rows}</tbody>\n</table></div>\n",
        line(headers, "th")
    )
}
