//! sRGB bytes and linear light.

use bevy_math::ops;
use std::sync::LazyLock;

/// Entries of the table that guesses a byte.
const GUESSES: usize = 1024;

/// Tables for both ways.
pub(super) struct Srgb {
    linear: [f32; 256],
    /// Least linear value that rounds to each byte.
    least: [f32; 256],
    /// For evenly spaced linear values, the byte of each.
    guesses: Vec<u8>,
}

impl Srgb {
    /// The tables, made once.
    pub fn tables() -> &'static Self {
        static TABLES: LazyLock<Srgb> = LazyLock::new(Srgb::new);
        &TABLES
    }

    fn new() -> Self {
        let linear = |byte: f32| {
            let value = byte / 255.0;
            if value <= 0.040_45 { value / 12.92 } else { ops::powf((value + 0.055) / 1.055, 2.4) }
        };
        let least: [f32; 256] = std::array::from_fn(|byte| linear((byte as f32 - 0.5).max(0.0)));
        let mut guesses = Vec::with_capacity(GUESSES + 1);
        for entry in 0..=GUESSES {
            let value = entry as f32 / GUESSES as f32;
            guesses.push((least.partition_point(|least| *least <= value).max(1) - 1) as u8);
        }
        Self { linear: std::array::from_fn(|byte| linear(byte as f32)), least, guesses }
    }

    /// Linear light of a byte.
    pub fn decode(&self, byte: u8) -> f32 {
        self.linear[byte as usize]
    }

    /// The byte nearest to linear light, on the scale of the bytes.
    pub fn encode(&self, value: f32) -> u8 {
        let value = value.clamp(0.0, 1.0);
        let mut byte = self.guesses[(value * GUESSES as f32) as usize] as usize;
        while byte < 255 && self.least[byte + 1] <= value {
            byte += 1;
        }
        byte as u8
    }

    /// Linear light on the scale of the bytes, not rounded: straight between the limits of each.
    pub fn scale(&self, value: f32) -> f32 {
        let byte = self.encode(value) as usize;
        let low = self.least[byte];
        let high = self.least.get(byte + 1).copied().unwrap_or(1.0);
        // Below the first and above the last byte there are only halves.
        let (from, to) = ((byte as f32 - 0.5).max(0.0), (byte as f32 + 0.5).min(255.0));
        from + (to - from) * ((value.clamp(low, high) - low) / (high - low))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_and_values_round_to_the_nearest() {
        let tables = Srgb::tables();
        for byte in 0..=255u8 {
            assert_eq!(tables.encode(tables.decode(byte)), byte);
        }
        for step in 0..=10_000 {
            let value = step as f32 / 10_000.0;
            let exact = if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * ops::powf(value, 1.0 / 2.4) - 0.055 };
            let byte = tables.encode(value);
            assert!((f32::from(byte) - 255.0 * exact).abs() < 0.501, "{byte} for {value}");
            let scaled = tables.scale(value);
            assert!((scaled - 255.0 * exact).abs() < 0.1, "{scaled} for {value}");
        }
        assert_eq!([tables.encode(-1.0), tables.encode(2.0), tables.encode(f32::NAN)], [0, 255, 0]);
    }
}
