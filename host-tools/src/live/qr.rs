//! An address as a QR code (ISO/IEC 18004) for a phone's camera.

use anyhow::{Context as _, Result};
use qrcode::render::unicode::Dense1x2;
use qrcode::{EcLevel, QrCode};

/// Black on white in colour, as a camera expects; without colours right on a dark terminal.
pub fn code(text: &str, in_colour: bool) -> Result<String> {
    let code = QrCode::with_error_correction_level(text, EcLevel::L).context("no QR code of the address")?;
    let mut image = code.render::<Dense1x2>();
    if !in_colour {
        return Ok(image.dark_color(Dense1x2::Light).light_color(Dense1x2::Dark).build());
    }
    let style = anstyle::Style::new()
        .fg_color(Some(anstyle::AnsiColor::Black.into()))
        .bg_color(Some(anstyle::AnsiColor::BrightWhite.into()));
    let lines = image.build();
    let lines = lines.lines().map(|line| format!("{style}{line}{style:#}"));
    Ok(lines.collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_is_square_and_as_dark_where_its_terminal_is_light() {
        let address = "http://192.168.1.5:8080/#token=0123456789abcdef0123456789abcdef";
        let plain = code(address, false).expect("a code");
        let coloured = code(address, true).expect("a code");
        let lines: Vec<&str> = plain.lines().collect();
        let width = lines[0].chars().count();
        // Two modules a character upwards; a quiet zone of four.
        assert!(width.div_ceil(2) == lines.len() && (33..=57).contains(&width), "{plain}");
        let other = |c| match c {
            '\u{2588}' => ' ',
            ' ' => '\u{2588}',
            '\u{2580}' => '\u{2584}',
            '\u{2584}' => '\u{2580}',
            other => other,
        };
        let inverted: String = lines[0].chars().map(other).collect();
        assert!(coloured.lines().next().is_some_and(|line| line.contains(&inverted)), "{coloured}");
    }
}
