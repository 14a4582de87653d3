//! x
/// l
pub struct Liver; /// s
pub struct LiverSettings;
