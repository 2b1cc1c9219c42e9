//! A small run of the stress program's cases: see `tools/stress`.

#[path = "../tools/stress/src/cases/mod.rs"]
mod cases;

#[test]
fn no_case_goes_wrong() {
    for case in cases::CASES {
        for row in case(0.004) {
            assert_eq!(row.wrong, 0, "{row:?}");
            assert!(row.tried > 0, "{row:?}");
        }
    }
}
