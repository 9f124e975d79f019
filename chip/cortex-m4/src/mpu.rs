//! The memory protection unit of `ARMv7-M` (`PMSAv7`) with eight regions, and the default memory map's places without code.
//!
//! With it on, instructions are decoded anew each time: the cache knows no permissions.

/// Base; attributes and size.
#[derive(Clone, Copy, Debug, Default)]
struct Region {
    base: u32,
    attributes: u32,
}

/// The unit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mpu {
    control: u32,
    number: u8,
    regions: [Region; 8],
}

impl Mpu {
    pub(crate) fn is_on(&self) -> bool {
        self.control & 1 != 0
    }

    /// A register from `0xE000_ED90`; `None` for other offsets.
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        let region = self.regions[usize::from(self.number)];
        match offset {
            0 => Some(8 << 8),
            4 => Some(self.control),
            8 => Some(u32::from(self.number)),
            0x0C | 0x14 | 0x1C | 0x24 => Some(self.region(offset).base | u32::from(self.number)),
            0x10 => Some(region.attributes),
            0x18 | 0x20 | 0x28 => Some(self.region(offset).attributes),
            _ => None,
        }
    }

    fn region(&self, offset: u32) -> Region {
        self.regions[self.alias(offset)]
    }

    fn alias(&self, offset: u32) -> usize {
        let alias = (offset - 0x0C) / 8;
        if alias == 0 { usize::from(self.number) } else { usize::from(self.number & 4) + alias as usize }
    }

    /// False for other offsets.
    pub(crate) fn write(&mut self, offset: u32, value: u32) -> bool {
        match offset {
            0 => {}
            4 => self.control = value & 7,
            8 => self.number = (value & 7) as u8,
            0x0C | 0x14 | 0x1C | 0x24 => {
                if value & 0x10 != 0 {
                    self.number = (value & 7) as u8;
                    self.regions[usize::from(self.number)].base = value & !0x1F;
                } else {
                    let place = self.alias(offset);
                    self.regions[place].base = value & !0x1F;
                }
            }
            0x10 | 0x18 | 0x20 | 0x28 => {
                let place = self.alias(offset - 4);
                self.regions[place].attributes = value & 0x173F_FF3F;
            }
            _ => return false,
        }
        true
    }

    /// The highest region with the address.
    fn deciding(&self, address: u32) -> Option<u32> {
        self.regions.iter().rev().find(|region| region.holds(address)).map(|region| region.attributes)
    }

    /// Off, or in a fault's handler without HFNMIENA.
    fn aside(&self, negative_priority: bool) -> bool {
        !self.is_on() || negative_priority && self.control & 2 == 0
    }

    pub(crate) fn allows_data(&self, address: u32, write: bool, privileged: bool, negative: bool) -> bool {
        if self.aside(negative) {
            return true;
        }
        match self.deciding(address) {
            None => privileged && self.control & 4 != 0,
            Some(attributes) => match attributes >> 24 & 7 {
                1 => privileged,
                2 => privileged || !write,
                3 => true,
                5 => privileged && !write,
                6 | 7 => !write,
                _ => false,
            },
        }
    }

    pub(crate) fn allows_code(&self, address: u32, privileged: bool, negative: bool) -> bool {
        let default = !matches!(address >> 29, 2 | 5 | 6 | 7);
        if self.aside(negative) || address >= 0xE000_0000 {
            return default;
        }
        match self.deciding(address) {
            None => default && privileged && self.control & 4 != 0,
            Some(attributes) => {
                attributes >> 28 & 1 == 0 && self.allows_data(address, false, privileged, negative)
            }
        }
    }
}

impl Region {
    fn holds(&self, address: u32) -> bool {
        let bits = (self.attributes >> 1 & 31) + 1;
        if self.attributes & 1 == 0 || bits < 5 {
            return false;
        }
        let inside = bits == 32 || address >> bits == self.base >> bits;
        let part = if bits >= 8 { address >> (bits - 3) & 7 } else { 0 };
        inside && (bits < 8 || self.attributes >> (8 + part) & 1 == 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_highest_region_that_holds_an_address_decides_and_a_disabled_eighth_does_not() {
        let mut mpu = Mpu::default();
        // 256 bytes at 0x2000_0000, all may read and write, the last eighth disabled; 1 KiB round it, read only.
        for (number, base, attributes) in
            [(0, 0x2000_0000, 6 << 24 | 9 << 1 | 1), (1, 0x2000_0000, 3 << 24 | 0x80 << 8 | 7 << 1 | 1)]
        {
            assert!(mpu.write(8, number) && mpu.write(0x0C, base) && mpu.write(0x10, attributes));
        }
        assert!(mpu.write(4, 1));
        for (address, readable, writable) in [
            (0x2000_0000, true, true),
            (0x2000_00DF, true, true),
            (0x2000_00E0, true, false),
            (0x2000_03FF, true, false),
            (0x2000_0400, false, false),
        ] {
            assert_eq!(mpu.allows_data(address, false, false, false), readable, "{address:#x}");
            assert_eq!(mpu.allows_data(address, true, false, false), writable, "{address:#x}");
            assert!(mpu.allows_data(address, true, false, true), "stands aside in a fault's handler");
        }
    }

    #[test]
    fn code_may_not_run_where_devices_are() {
        let mpu = Mpu::default();
        for (address, allowed) in
            [(0, true), (0x2000_0000, true), (0x4000_0000, false), (0x6000_0000, true), (0xE000_E000, false)]
        {
            assert_eq!(mpu.allows_code(address, true, false), allowed, "{address:#x}");
        }
    }
}
