//! Generates two things from the message definitions (XML) of the `mavlink` crate: the layout table, and structures
//! of the messages that are read by field. The crate's own generator makes the latter.

use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use mavlink_bindgen::XmlDefinitions;
use roxmltree::{Document, Node};

#[path = "src/crc.rs"]
#[expect(dead_code, unreachable_pub, reason = "the crate's own file, for its checksum over a definition")]
mod crc;
#[path = "src/wire.rs"]
#[expect(dead_code, unreachable_pub, reason = "the crate's own file, for the longest payload")]
mod wire;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The root of the definitions: all published ones, ArduPilot's and PX4's dialects included.
const ROOT: &str = "all.xml";

const READ_FROM: &str = "ardupilotmega.xml";

/// Their names. A structure is generated for each; all of a dialect would take half a minute to compile.
const READ: &[&str] = &[
    "AHRS2",
    "ATTITUDE",
    "ATTITUDE_TARGET",
    "AUTOPILOT_VERSION",
    "BATTERY_STATUS",
    "EFI_STATUS",
    "EKF_STATUS_REPORT",
    "ESC_INFO",
    "ESC_STATUS",
    "ESC_TELEMETRY_1_TO_4",
    "ESC_TELEMETRY_5_TO_8",
    "ESTIMATOR_STATUS",
    "GENERATOR_STATUS",
    "GLOBAL_POSITION_INT",
    "GPS2_RAW",
    "GPS_RAW_INT",
    "HIGHRES_IMU",
    "LOCAL_POSITION_NED",
    "MCU_STATUS",
    "MISSION_ITEM_REACHED",
    "NAV_CONTROLLER_OUTPUT",
    "POWER_STATUS",
    "RADIO_STATUS",
    "RAW_IMU",
    "RAW_RPM",
    "RC_CHANNELS",
    "RPM",
    "SCALED_IMU",
    "SCALED_IMU2",
    "SCALED_IMU3",
    "SCALED_PRESSURE",
    "SCALED_PRESSURE2",
    "SERVO_OUTPUT_RAW",
    "SYSTEM_TIME",
    "SYS_STATUS",
    "VFR_HUD",
    "VIBRATION",
];

struct Field {
    name: String,
    /// The type as the checksum seed spells it: `uint8_t`, `char`, …
    type_name: String,
    kind: &'static str,
    size: usize,
    /// `None` for a scalar.
    array: Option<usize>,
    extension: bool,
    role: &'static str,
    units: String,
    enumeration: String,
}

struct Message {
    name: String,
    /// In wire order.
    fields: Vec<Field>,
}

fn main() -> Result<()> {
    for ours in ["build.rs", "src/crc.rs", "src/wire.rs"] {
        println!("cargo::rerun-if-changed={ours}");
    }
    println!("cargo::rerun-if-changed=../../Cargo.lock");
    // The generated code asks for these features, which do not exist here.
    println!("cargo::rustc-check-cfg=cfg(feature, values(\"arbitrary\", \"serde\", \"ts-rs\"))");
    let definitions = mavlink_crate_dir()?.join("mavlink/message_definitions/v1.0");
    let mut messages = BTreeMap::new();
    read_file(&definitions, ROOT, &mut BTreeSet::new(), &mut messages)?;
    let out = PathBuf::from(env::var("OUT_DIR")?).join("table.rs");
    fs::write(out, render(&messages)?)?;
    write_structures(&definitions)
}

/// Structures of the messages in [`READ`]: the definitions without all other messages, bound as in the `mavlink`
/// crate.
fn write_structures(definitions: &Path) -> Result<()> {
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let (mut files, mut messages) = (BTreeSet::new(), BTreeMap::new());
    read_file(definitions, READ_FROM, &mut files, &mut messages)?;
    let read: Vec<&Message> =
        messages.values().filter(|message| READ.contains(&message.name.as_str())).collect();
    if read.len() != READ.len() {
        return Err(
            format!("{READ_FROM} defines only {} of the {} messages read", read.len(), READ.len()).into()
        );
    }
    let enumerations =
        read.iter().flat_map(|message| &message.fields).map(|field| field.enumeration.as_str());
    let kept: BTreeSet<&str> = READ.iter().copied().chain(enumerations).collect();
    let folder = out.join("definitions");
    fs::create_dir_all(&folder)?;
    for name in &files {
        let text = fs::read_to_string(definitions.join(name))?;
        fs::write(folder.join(name), only(&text, &kept)?)?;
    }
    mavlink_bindgen::generate(XmlDefinitions::Files(vec![folder.join(READ_FROM)]), &out)?;
    fs::write(out.join("structures.rs"), "pub mod ardupilotmega;\n")?;
    Ok(())
}

fn only(text: &str, kept: &BTreeSet<&str>) -> Result<String> {
    let document = Document::parse(text)?;
    let (mut out, mut from) = (String::new(), 0);
    for node in document.descendants().filter(|node| matches!(node.tag_name().name(), "message" | "enum")) {
        if !kept.contains(attribute(node, "name")?) {
            out.push_str(&text[from..node.range().start]);
            from = node.range().end;
        }
    }
    out.push_str(&text[from..]);
    Ok(out)
}

fn mavlink_crate_dir() -> Result<PathBuf> {
    let metadata = cargo_metadata::MetadataCommand::new()
        .other_options(vec!["--filter-platform".into(), env::var("TARGET")?])
        .exec()?;
    let package = metadata
        .packages
        .iter()
        .find(|package| package.name.as_str() == "mavlink")
        .ok_or("the workspace does not depend on the mavlink crate")?;
    let manifest = package.manifest_path.clone().into_std_path_buf();
    Ok(manifest.parent().ok_or("the mavlink crate has no directory")?.to_path_buf())
}

fn read_file(
    dir: &Path,
    name: &str,
    seen: &mut BTreeSet<String>,
    messages: &mut BTreeMap<u32, Message>,
) -> Result<()> {
    if !seen.insert(name.to_owned()) {
        return Ok(());
    }
    let path = dir.join(name);
    println!("cargo::rerun-if-changed={}", path.display());
    let text = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let document = Document::parse(&text)?;
    for node in document.descendants().filter(Node::is_element) {
        match node.tag_name().name() {
            "include" => read_file(dir, node.text().unwrap_or_default().trim(), seen, messages)?,
            "message" => {
                let id: u32 = attribute(node, "id")?.parse()?;
                let message = read_message(node)?;
                if let Some(other) = messages.get(&id) {
                    if other.name != message.name {
                        return Err(format!("message id {id}: {} and {}", other.name, message.name).into());
                    }
                    continue;
                }
                messages.insert(id, message);
            }
            _ => {}
        }
    }
    Ok(())
}

fn attribute<'a>(node: Node<'a, '_>, name: &str) -> Result<&'a str> {
    node.attribute(name).ok_or_else(|| format!("<{}> has no attribute {name}", node.tag_name().name()).into())
}

fn read_message(node: Node) -> Result<Message> {
    let name = attribute(node, "name")?.to_owned();
    let mut base = Vec::new();
    let mut extensions = Vec::new();
    let mut in_extensions = false;
    for child in node.children().filter(Node::is_element) {
        match child.tag_name().name() {
            "extensions" => in_extensions = true,
            "field" if in_extensions => extensions.push(read_field(child, true)?),
            "field" => base.push(read_field(child, false)?),
            _ => {}
        }
    }
    // Wire order: by size of the element, largest first, otherwise as defined; extensions stay as defined.
    base.sort_by_key(|field| std::cmp::Reverse(field.size));
    base.append(&mut extensions);
    Ok(Message { name, fields: base })
}

fn read_field(node: Node, extension: bool) -> Result<Field> {
    let spelled = attribute(node, "type")?;
    let (base, array) = match spelled.split_once('[') {
        Some((base, rest)) => (base, Some(rest.trim_end_matches(']').parse()?)),
        None => (spelled, None),
    };
    // "uint8_t_mavlink_version" is a uint8_t that the sender's library fills in.
    let type_name = base.trim_end_matches("_mavlink_version");
    let (kind, size) = match type_name {
        "uint8_t" => ("U8", 1),
        "int8_t" => ("I8", 1),
        "char" => ("Char", 1),
        "uint16_t" => ("U16", 2),
        "int16_t" => ("I16", 2),
        "uint32_t" => ("U32", 4),
        "int32_t" => ("I32", 4),
        "float" => ("F32", 4),
        "uint64_t" => ("U64", 8),
        "int64_t" => ("I64", 8),
        "double" => ("F64", 8),
        other => return Err(format!("unknown field type {other}").into()),
    };
    Ok(Field {
        name: attribute(node, "name")?.to_owned(),
        type_name: type_name.to_owned(),
        kind,
        size,
        array,
        extension,
        role: role(node),
        units: node.attribute("units").unwrap_or_default().to_owned(),
        enumeration: node.attribute("enum").unwrap_or_default().to_owned(),
    })
}

fn role(node: Node) -> &'static str {
    let time = node.attribute("name").is_some_and(|name| name.starts_with("time"));
    match node.attribute("units") {
        _ if node.attribute("instance") == Some("true") => "Instance",
        Some("ms") if time => "Millis",
        Some("us") if time => "Micros",
        _ => "Plain",
    }
}

/// The checksum seed of a message, by which different definitions of one id are incompatible. It covers the name,
/// then type, name and array length of each field but the extensions, in wire order (MAVLink serialization guide,
/// "`CRC_EXTRA` calculation").
fn crc_extra(message: &Message) -> u8 {
    let feed = |sum, text: &str| crc::step(crc::update(sum, text.as_bytes()), b' ');
    let mut sum = feed(crc::START, &message.name);
    for field in message.fields.iter().filter(|field| !field.extension) {
        sum = feed(sum, &field.type_name);
        sum = feed(sum, &field.name);
        if let Some(count) = field.array {
            sum = crc::step(sum, count as u8);
        }
    }
    (sum ^ (sum >> 8)) as u8
}

fn render(messages: &BTreeMap<u32, Message>) -> Result<String> {
    let mut out = String::from("// Generated by build.rs.\npub(crate) static MESSAGES: &[Message] = &[\n");
    for (id, message) in messages {
        let bytes = |extensions: bool| -> usize {
            let counted = message.fields.iter().filter(|field| extensions || !field.extension);
            counted.map(|field| field.size * field.array.unwrap_or(1)).sum()
        };
        let (min, max) = (bytes(false), bytes(true));
        if max > wire::PAYLOAD_BYTES_MAX {
            return Err(format!("{}: {max} bytes do not fit a frame", message.name).into());
        }
        let offset = |name: &str| -> usize {
            let at = message.fields.iter().position(|field| field.name == name && field.kind == "U8");
            let before = |at| &message.fields[..at];
            at.map_or(255, |at| before(at).iter().map(|field| field.size * field.array.unwrap_or(1)).sum())
        };
        let (system, component) = (offset("target_system"), offset("target_component"));
        writeln!(
            out,
            "    Message {{ id: {id}, crc_extra: {}, len_base: {min}, len_max: {max}, \
             target_system: {system}, target_component: {component}, \
             #[cfg(feature = \"names\")] name: {:?}, fields: &[",
            crc_extra(message),
            message.name
        )?;
        for field in &message.fields {
            writeln!(
                out,
                "        Field {{ kind: Kind::{}, array: {}, role: Role::{}, #[cfg(feature = \"names\")] name: {:?}, \
                 #[cfg(feature = \"names\")] units: {:?}, #[cfg(feature = \"names\")] enumeration: {:?} }},",
                field.kind,
                field.array.unwrap_or(0),
                field.role,
                field.name,
                field.units,
                field.enumeration
            )?;
        }
        writeln!(out, "    ] }},")?;
    }
    out.push_str("];\n\n/// The id of each message, by its name in the definitions.\npub mod ids {\n");
    for (id, message) in messages {
        let name = &message.name;
        writeln!(out, "    /// `{name}`\n    pub const {name}: u32 = {id};")?;
    }
    out.push_str("}\n");
    Ok(out)
}
