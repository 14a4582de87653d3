use crate::{house::House, sources};
pub fn parts_below(part: &str) -> &'static [&'static str] {
    match part {
        "synthesis" => &["synthesis"],
        "plugin" => &["plugin", "synthesis"],
        "render" => &["render", "plugin", "synthesis"],
        "ui" => &["ui", "plugin", "synthesis"],
        _ => &[],
    }
}
#[test]
fn circles() {
    let house = House::new(sources(&["src"]));
    for c in house.circles() {
        println!("{}", house.describe(&c));
    }
    println!(
        "RENDER {}",
        house.describe(
            &(0..house.sources.len()).filter(|&i| house.sources[i].path.starts_with("src/render/")).collect::<Vec<_>>()
        )
    );
    let mut edges = std::collections::BTreeMap::new();
    for (i, s) in house.sources.iter().enumerate() {
        for &j in &house.uses[i] {
            let t = &house.sources[j];
            if s.module.len() >= 2 && t.module.len() >= 2 && s.module[0] == t.module[0] && s.module[1] != t.module[1] {
                edges
                    .entry((s.module[0].clone(), s.module[1].clone()))
                    .or_insert(std::collections::BTreeMap::<String, Vec<String>>::new())
                    .entry(t.module[1].clone())
                    .or_default()
                    .push(format!("{}->{}", s.path.trim_start_matches("src/"), t.path.trim_start_matches("src/")));
            }
        }
    }
    for (k, v) in edges {
        println!("{k:?}");
        for (t, l) in v {
            println!("    {t}: {}", l.iter().take(3).cloned().collect::<Vec<_>>().join("  "));
        }
    }
}
