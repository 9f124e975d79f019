//! The picture, in Graphviz's language: a box for each crate, in it its modules, arrows to what each needs.
//!
//! A folder is drawn as one module. An arrow that others imply is left out (the transitive reduction, which there is
//! where no circle is); between crates the arrows are those of the crates.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use petgraph::algo::toposort;
use petgraph::algo::tred::{dag_to_toposorted_adjacency_list, dag_transitive_reduction_closure};
use petgraph::graph::DiGraph;
use petgraph::visit::IntoNeighbors as _;

use super::resolve::{Import, room};
use super::source::Crate;

/// Arrows between things with names.
type Arrows = BTreeSet<(String, String)>;

pub(super) fn dot(crates: &[Crate], imports: &[Import]) -> String {
    let mut between = Arrows::new();
    let mut floors: BTreeMap<&str, Floor> = BTreeMap::new();
    for import in imports {
        let [from, to] = [import.from, import.to].map(|place| crates[place.0].name.as_str());
        let rooms = [import.from, import.to].map(|place| room(crates, place));
        if from != to {
            between.insert((from.to_owned(), to.to_owned()));
            // What is used by other crates alone is a room too.
            floors.entry(from).or_default().rooms.insert(rooms[0].clone());
            floors.entry(to).or_default().rooms.insert(rooms[1].clone());
        } else if rooms[0] != rooms[1] {
            let floor = floors.entry(from).or_default();
            floor.rooms.extend(rooms.iter().cloned());
            let [from, to] = rooms;
            floor.arrows.insert((from, to));
        }
    }

    let mut text = String::from(HEAD);
    for (name, floor) in &mut floors {
        floor.arrows = reduced(&floor.arrows);
        text.push_str(&floor.dot(name));
    }
    text.push('\n');
    for (from, to) in reduced(&between) {
        let (Some(upper), Some(lower)) = (floors.get(from.as_str()), floors.get(to.as_str())) else {
            continue;
        };
        let _ = writeln!(
            text,
            "  \"{}\" -> \"{}\" [ltail=\"cluster_{from}\", lhead=\"cluster_{to}\", color=\"#1f4e79\", penwidth=1.6];",
            upper.lowest(),
            lower.highest(),
        );
    }
    text.push_str("}\n");
    text
}

const HEAD: &str = r##"// Drawn by `cargo xtask structure` from the code: not by hand.
digraph modules {
  compound=true; rankdir=TB; ranksep=0.3; nodesep=0.12; fontname="sans-serif"; bgcolor=white;
  node [shape=box, style="rounded,filled", fillcolor=white, color="#7a8794", fontname="sans-serif",
        fontsize=10, height=0.25, margin="0.08,0.03"];
  edge [color="#7a8794", arrowsize=0.5];
"##;

/// A crate's rooms.
#[derive(Default)]
struct Floor {
    rooms: BTreeSet<String>,
    arrows: Arrows,
}

impl Floor {
    fn dot(&self, name: &str) -> String {
        let mut text = format!(
            "\n  subgraph \"cluster_{name}\" {{\n    label=\"{name}\"; style=\"rounded,filled\"; fillcolor=\"#eef2f6\"; color=\"#b8c4d0\";\n"
        );
        for room in &self.rooms {
            let shown = room.split_once("::").map_or("(root)", |(_, module)| module);
            let _ = writeln!(text, "    \"{room}\" [label=\"{shown}\"];");
        }
        for (from, to) in &self.arrows {
            let _ = writeln!(text, "    \"{from}\" -> \"{to}\";");
        }
        text.push_str("  }\n");
        text
    }

    /// A room that stands on no other, at the end of the longest way down: arrows to the crates below start here, so
    /// that these are drawn below.
    fn lowest(&self) -> &str {
        self.rooms.iter().max_by_key(|room| self.depth(room, self.rooms.len())).map_or("", String::as_str)
    }

    /// A room that nobody in the crate stands on.
    fn highest(&self) -> &str {
        self.rooms.iter().min_by_key(|room| self.depth(room, self.rooms.len())).map_or("", String::as_str)
    }

    /// Arrows on the longest way to `room`; at most `limit`, should they go in a circle.
    fn depth(&self, room: &str, limit: usize) -> usize {
        let Some(left) = limit.checked_sub(1) else { return 0 };
        let above = self.arrows.iter().filter(|(_, to)| to == room);
        above.map(|(from, _)| 1 + self.depth(from, left)).max().unwrap_or(0)
    }
}

/// Without the arrows that a way over others implies; as they are where they go in a circle.
fn reduced(arrows: &Arrows) -> Arrows {
    let mut graph = DiGraph::<&str, ()>::new();
    let mut nodes = BTreeMap::new();
    for name in arrows.iter().flat_map(|(from, to)| [from, to]) {
        nodes.entry(name.as_str()).or_insert_with(|| graph.add_node(name));
    }
    for (from, to) in arrows {
        graph.add_edge(nodes[from.as_str()], nodes[to.as_str()], ());
    }
    let Ok(order) = toposort(&graph, None) else { return arrows.clone() };
    let (list, _) = dag_to_toposorted_adjacency_list::<_, u32>(&graph, &order);
    let (reduction, _) = dag_transitive_reduction_closure(&list);
    let name = |position: u32| graph[order[position as usize]].to_owned();
    reduction
        .node_indices()
        .flat_map(|from| reduction.neighbors(from).map(move |to| (from, to)))
        .map(|(from, to)| (name(from), name(to)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrows(list: &[(&str, &str)]) -> Arrows {
        list.iter().map(|(from, to)| ((*from).to_owned(), (*to).to_owned())).collect()
    }

    #[test]
    fn an_arrow_that_others_imply_is_not_drawn() {
        let all = arrows(&[("a", "b"), ("b", "c"), ("a", "c"), ("a", "d")]);
        assert_eq!(reduced(&all), arrows(&[("a", "b"), ("b", "c"), ("a", "d")]));
    }

    #[test]
    fn a_circle_is_drawn_as_it_is() {
        let all = arrows(&[("a", "b"), ("b", "a"), ("a", "c")]);
        assert_eq!(reduced(&all), all);
    }
}
