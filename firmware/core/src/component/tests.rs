use super::*;

fn params(set: &[(&str, f32)]) -> Params {
    let mut params = Params::defaults();
    for (name, value) in set {
        params.set(name, *value).expect(name);
    }
    params
}

fn flown(hours: f64, flights: f64) -> Totals {
    let mut totals = Totals::default();
    totals.add(UsageCounter::Flight, hours * 3_600.0);
    totals.add(UsageCounter::Flights, flights);
    totals.motors[1].seconds = hours * 3_600.0;
    totals
}

#[test]
fn the_limit_that_trips_first_decides() {
    let params = params(&[("CMP2_KIND", 1.0), ("CMP2_HOURS", 100.0), ("CMP2_FLIGHTS", 10.0)]);
    let mut component = Component::default();
    for (hours, flights, status) in [
        (89.0, 1.0, Status::Green),
        (91.0, 1.0, Status::Yellow),
        (2.0, 9.0, Status::Yellow),
        (2.0, 10.0, Status::Red),
    ] {
        component.kind = ComponentKind::Airframe;
        let is = component.status(1, &flown(hours, flights), &params);
        assert_eq!(is, status, "{hours} h, {flights} flights");
    }
    assert_eq!(component.used_percent(0, &flown(1e6, 1e6), &params), None, "without a limit");
}

#[test]
fn a_replaced_part_has_run_nothing_and_the_old_ones_figures_are_told() {
    let params = params(&[("CMP1_KIND", 3.0), ("CMP1_NUMBER", 2.0), ("CMP1_MOT_HOURS", 50.0)]);
    let mut component = Component::default();
    assert!(component.describe(0, &Totals::default(), &params));
    let totals = flown(60.0, 5.0);
    assert_eq!(component.status(0, &totals, &params), Status::Red);
    let old = component.replace(Label::new("SN 2"), &totals);
    assert_eq!((old.serial, old.ran.flights), (Label::default(), 5.0));
    assert_eq!(
        (component.figures(&totals), component.serial.as_str()),
        (ComponentFigures::default(), "SN 2")
    );
    assert_eq!(component.status(0, &totals, &params), Status::Green);
}

#[test]
fn a_component_reads_back_and_the_session_is_added_once() {
    let params = params(&[("CMP1_KIND", 2.0), ("CMP1_NUMBER", 1.0)]);
    let mut totals = flown(1.0, 2.0);
    totals.battery_cycles = [0.75, 0.0, 0.0, 0.0];
    let mut component = Component { name: Label::new("pack A"), ..Component::default() };
    component.describe(0, &Totals::default(), &params);
    let ran =
        ComponentFigures { cycles: 0.75, flight_s: 3_600.0, flights: 2.0, motor_s: 3_600.0, powered_s: 0.0 };
    let mut replaced = component;
    replaced.replace(Label::new("pack B"), &totals);
    for (component, boots, expected) in [
        (component, 5, ran),
        (component, 6, ComponentFigures::default()),
        (replaced, 5, ComponentFigures::default()),
    ] {
        let mut stored = [0; Component::BYTES];
        Component { as_of: boots, ..component }.encode(&mut stored);
        let mut read = Component::decode(&stored).expect("readable");
        assert_eq!((read.name.as_str(), read.kind, read.number), ("pack A", ComponentKind::Battery, 1));
        read.add(5, &totals);
        assert_eq!(read.ran, expected, "as of power-on {boots}");
        for cut in 0..Component::BYTES {
            assert_eq!(Component::decode(&stored[..cut]), Err(Unreadable));
        }
    }
}

#[test]
fn a_label_is_printable_and_ends() {
    assert_eq!(Label::new("näme\n of sixteen and more").as_str(), "nme of sixteen a");
    assert_eq!(Label::of([0xFF; LABEL_BYTES].into_iter()).as_str(), "");
}
