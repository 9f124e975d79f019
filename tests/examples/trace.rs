//! Prints each instruction between two moments: `trace IMAGE FROM-US TO-US [FLIGHT]`.

use hums_tests::chip;
use stm32f405_model::image::Image;
use stm32f405_model::machine::Board;
use stm32f405_model::time::{MS, NEVER, US};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, image, from, to, rest @ ..] = arguments.as_slice() else {
        return Err("trace IMAGE FROM-US TO-US [FLIGHT]".into());
    };
    let image = Image::parse(&std::fs::read(image)?)?;
    let (from, to) = (from.parse::<u64>()? * US, to.parse::<u64>()? * US);
    let (mut machine, _, _) = chip::board(image, Board::default());
    if let Some(path) = rest.first() {
        chip::Feed::read(path.as_ref(), 1_500 * MS)?.give(&mut machine, NEVER / 2);
    }
    machine.run_until(from).map_err(|report| report.to_string())?;
    let mut last = 0;
    while machine.now() < to {
        let pc = machine.core.register(15);
        if pc != last {
            last = pc;
            let name =
                machine.image().symbol(pc).map_or_else(String::new, |(name, at)| format!("{name}+{at:#x}"));
            let registers: Vec<_> =
                (0..15).map(|number| format!("{:x}", machine.core.register(number))).collect();
            println!("{} {pc:08x} {name} [{}]", machine.now() / 1_000, registers.join(" "));
        }
        let next = machine.chip.time.ps(machine.core.cycles() + 1);
        machine.run_until(next.max(machine.now() + 1)).map_err(|report| report.to_string())?;
    }
    Ok(())
}
