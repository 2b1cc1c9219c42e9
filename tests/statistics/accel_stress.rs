//! A small run of the stress program's cases: see `tools/stress`.

#[path = "../../tools/stress/src/cases/mod.rs"]
mod cases;

#[test]
fn no_case_goes_wrong() {
    for case in cases::CASES {
        for row in case(0.004) {
            let cases::Row { what, tried, wrong, worst } = row;
            assert!(tried > 0, "{what}: nothing was tried");
            assert_eq!(wrong, 0, "{what}: of {tried}; worst: {worst}");
        }
    }
}
