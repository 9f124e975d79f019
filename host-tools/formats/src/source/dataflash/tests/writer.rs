//! Writes logs, as they should be or not.

#[derive(Clone, Debug, Default)]
pub(super) struct Writer {
    pub(super) bytes: Vec<u8>,
    has_attitude: bool,
}

impl Writer {
    /// With FMT.
    pub(super) fn new() -> Self {
        let mut log = Self::default();
        log.format_of(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
        log
    }

    fn size(character: char) -> u8 {
        match character {
            'b' | 'B' | 'M' => 1,
            'h' | 'H' | 'c' | 'C' | 'g' => 2,
            'i' | 'I' | 'f' | 'n' | 'e' | 'E' | 'L' => 4,
            'd' | 'q' | 'Q' => 8,
            'N' => 16,
            _ => 64,
        }
    }

    pub(super) fn format(&mut self, kind: u8, name: &str, characters: &str, columns: &str) {
        let length = 3 + characters.chars().map(Self::size).fold(0, u8::wrapping_add);
        self.format_of(kind, length, name, characters, columns);
    }

    pub(super) fn format_of(&mut self, kind: u8, length: u8, name: &str, characters: &str, columns: &str) {
        let (name, characters, columns) = (padded(name, 4), padded(characters, 16), padded(columns, 64));
        self.raw(128, &[&[kind, length], &name, &characters, &columns]);
    }

    pub(super) fn raw(&mut self, kind: u8, payload: &[&[u8]]) {
        self.bytes.extend([0xA3, 0x95, kind]);
        for bytes in payload {
            self.bytes.extend_from_slice(bytes);
        }
    }

    /// The tests' units.
    pub(super) fn units(&mut self, kind: u8, units: &str, multipliers: &str) {
        self.format(200, "UNIT", "QbZ", "TimeUS,Id,Label");
        self.format(201, "MULT", "Qbd", "TimeUS,Id,Mult");
        self.format(202, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
        let time = 1_u64.to_le_bytes();
        for (id, label) in [(b's', "s"), (b'i', "A.s"), (b'O', "degC")] {
            self.raw(200, &[&time, &[id], &padded(label, 64)]);
        }
        for (id, factor) in [(b'F', 1e-6_f64), (b'!', 3.6), (b'B', 1e-2)] {
            self.raw(201, &[&time, &[id], &factor.to_le_bytes()]);
        }
        self.raw(202, &[&time, &[kind], &padded(units, 16), &padded(multipliers, 16)]);
    }

    /// ATT (150) each second.
    pub(super) fn attitudes(&mut self, seconds: std::ops::Range<u64>) {
        if !std::mem::replace(&mut self.has_attitude, true) {
            self.format(150, "ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw");
        }
        for second in seconds {
            let angles: Vec<u8> = [100_i16, -200, 300].iter().flat_map(|angle| angle.to_le_bytes()).collect();
            self.raw(150, &[&(second * 1_000_000).to_le_bytes(), &angles]);
        }
    }

    /// MSG (160).
    pub(super) fn message(&mut self, second: f64, words: &str) {
        self.raw(160, &[&((second * 1e6) as u64).to_le_bytes(), &padded(words, 64)]);
    }
}

fn padded(words: &str, length: usize) -> Vec<u8> {
    let mut bytes = words.as_bytes().to_vec();
    bytes.resize(length, 0);
    bytes
}
