//! The argument of `--preview`.

use std::str::FromStr;

/// Where a running tev listens unless told otherwise.
const TEV: &str = "127.0.0.1:14158";

/// Where a running render is shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum PreviewArg {
    /// On a page that a browser opens.
    Page,
    /// On a page whose address is printed only.
    Address,
    /// By the viewer tev, which listens at an address.
    Tev(String),
}

impl FromStr for PreviewArg {
    type Err = String;

    fn from_str(text: &str) -> Result<PreviewArg, String> {
        match text {
            "page" => Ok(PreviewArg::Page),
            "address" => Ok(PreviewArg::Address),
            "tev" => Ok(PreviewArg::Tev(TEV.to_string())),
            _ => match text.strip_prefix("tev:") {
                Some(address) if address.contains(':') => Ok(PreviewArg::Tev(address.to_string())),
                _ => Err("it is page, address, tev, or tev:HOST:PORT".to_string()),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viewers_are_named() {
        assert_eq!("address".parse(), Ok(PreviewArg::Address));
        assert_eq!("tev".parse(), Ok(PreviewArg::Tev("127.0.0.1:14158".to_string())));
        assert_eq!("tev:[::1]:99".parse(), Ok(PreviewArg::Tev("[::1]:99".to_string())));
        for wrong in ["tev:", "tev:host", "Page", ""] {
            assert!(wrong.parse::<PreviewArg>().is_err(), "{wrong}");
        }
    }
}
