//! Foreign programs on the model: `foreign FOLDER` runs each file, and judges it by its source's text. `cargo xtask prove
//! foreign` builds them from their packages.
#![allow(clippy::print_stdout, reason = "a program's results")]

mod bench;
mod boards;
mod embassy;
mod hal;

use std::path::Path;
use std::process::ExitCode;

use stm32f405_model::image::Image;
use stm32f405_model::machine::{Board, Machine};

use bench::Outcome;

/// Name, crystal, judge.
type Program = (&'static str, u32, fn(&mut Machine) -> Outcome);

const MHZ: u32 = 1_000_000;

const PROGRAMS: &[Program] = &[
    ("stm32f4xx-hal.serial-dma", 8 * MHZ, hal::serial_dma),
    ("stm32f4xx-hal.rtic-serial-dma-rx-idle", 8 * MHZ, hal::rtic_serial_dma_rx_idle),
    ("stm32f4xx-hal.spi-dma", 8 * MHZ, hal::spi_dma),
    ("stm32f4xx-hal.rtic-button", 25 * MHZ, hal::rtic_button),
    ("stm32f4xx-hal.rtic-tick", 8 * MHZ, hal::rtic_tick),
    ("stm32f4xx-hal.rtic-usart-shell", 25 * MHZ, hal::rtic_usart_shell),
    ("stm32f4xx-hal.delay-timer-blinky", 25 * MHZ, hal::delay_timer_blinky),
    ("stm32f4xx-hal.blinky-timer-irq", 8 * MHZ, hal::blinky_timer_irq),
    ("stm32f4xx-hal.delay-syst-blinky", 8 * MHZ, hal::delay_syst_blinky),
    ("feather-f405.flash", 12 * MHZ, boards::flash),
    ("stm32f407g-disc.serial_echo", 8 * MHZ, boards::serial_echo),
    ("stm32f407g-disc.gpio_hal_blinky", 8 * MHZ, boards::gpio_hal_blinky),
    ("embassy.wdt", 8 * MHZ, embassy::wdt),
    ("embassy.flash", 8 * MHZ, embassy::flash),
    ("embassy.usart_dma", 8 * MHZ, embassy::usart_dma),
    ("embassy.usart_buffered", 8 * MHZ, embassy::usart_buffered),
    ("embassy.button_exti", 8 * MHZ, embassy::button_exti),
    ("embassy.multiprio", 8 * MHZ, embassy::multiprio),
];

fn main() -> ExitCode {
    let Some(folder) = std::env::args().nth(1) else {
        eprintln!("foreign FOLDER");
        return ExitCode::from(2);
    };
    match judge(Path::new(&folder)) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(failed) => {
            eprintln!("error: {failed} programs did not do what they say");
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("error: {folder}: {error}");
            ExitCode::from(2)
        }
    }
}

fn judge(folder: &Path) -> std::io::Result<usize> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    let mut failed = 0;
    for name in names {
        let bytes = std::fs::read(folder.join(&name))?;
        match one(&name, &bytes) {
            Ok(notes) => println!("{name}: did what it says; notes {notes}"),
            Err(error) => {
                println!("{name}: {error}");
                failed += 1;
            }
        }
    }
    Ok(failed)
}

fn one(name: &str, bytes: &[u8]) -> Result<String, Box<dyn std::error::Error>> {
    let Some((_, hse_hz, check)) = PROGRAMS.iter().find(|(known, ..)| *known == name) else {
        return Err("nobody knows what it should do".into());
    };
    let mut machine = Machine::new(Image::parse(bytes)?, Board { hse_hz: *hse_hz, ..Board::default() });
    check(&mut machine)?;
    Ok(format!("{:?}", machine.chip.notes))
}
