//! Lists the attached controllers and selects one of them.

use jointrig_protocol::usb::{PRODUCT, PRODUCT_ID, VENDOR_ID};
use nusb::{DeviceInfo, MaybeFuture};

/// A controller attached to this computer. It was found without opening it.
pub struct Attached {
    /// Its serial number, when the system knows it.
    pub serial: Option<String>,
    pub(super) info: DeviceInfo,
}

impl Attached {
    /// Its address.
    pub fn address(&self) -> String {
        format!("usb:{}", self.serial.as_deref().unwrap_or_default())
    }
}

/// Lists all attached controllers.
///
/// # Errors
/// The system cannot list its USB devices.
pub fn attached() -> Result<Vec<Attached>, nusb::Error> {
    let devices = nusb::list_devices().wait()?;
    let ours = devices
        .filter(|device| is_controller(device.vendor_id(), device.product_id(), device.product_string()));
    Ok(ours.map(|info| Attached { serial: info.serial_number().map(Into::into), info }).collect())
}

/// Vendor and product ids are test ids that other devices may share, so the product name decides
/// where the system knows it.
fn is_controller(vendor: u16, product: u16, name: Option<&str>) -> bool {
    (vendor, product) == (VENDOR_ID, PRODUCT_ID) && name.is_none_or(|name| name == PRODUCT)
}

/// Index of the controller with the serial number `wanted`, or of the only one.
pub(super) fn choose(list: &[Attached], wanted: Option<&str>) -> Result<usize, String> {
    let serials: Vec<_> = list.iter().map(|one| one.serial.as_deref()).collect();
    choose_serial(&serials, wanted)
}

fn choose_serial(serials: &[Option<&str>], wanted: Option<&str>) -> Result<usize, String> {
    let named = || {
        let names: Vec<_> = serials.iter().map(|serial| format!("usb:{}", serial.unwrap_or("?"))).collect();
        names.join(", ")
    };
    let meant = |serial: Option<&str>| match wanted {
        Some(wanted) => serial.is_some_and(|serial| serial.eq_ignore_ascii_case(wanted)),
        None => true,
    };
    let mut places = (0..serials.len()).filter(|place| meant(serials[*place]));
    match (places.next(), places.next(), wanted) {
        (Some(place), None, _) => Ok(place),
        (Some(_), Some(_), None) => {
            Err(format!("{} controllers are attached: name one of {}", serials.len(), named()))
        }
        (Some(_), Some(_), Some(wanted)) => {
            Err(format!("several controllers say that their serial number is {wanted}: unplug all but one"))
        }
        (None, _, _) if serials.is_empty() => Err(
            "no controller is attached: check its cable and that it is powered; `jointrig devices` lists \
                 what is there"
                .into(),
        ),
        (None, _, _) => Err(format!("there is no such serial number; attached: {}", named())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_only_one_needs_no_name_and_a_name_finds_its_own() {
        assert_eq!(choose_serial(&[Some("0042")], None), Ok(0));
        assert_eq!(choose_serial(&[None], None), Ok(0));
        assert_eq!(choose_serial(&[Some("0042"), Some("00AF"), None], Some("00af")), Ok(1));
    }

    #[test]
    fn what_cannot_be_chosen_is_said_with_what_is_there() {
        for (serials, wanted, words) in [
            (&[][..], None, &["no controller is attached"][..]),
            (&[], Some("1"), &["no controller is attached"]),
            (&[Some("1"), None], None, &["2 controllers", "usb:1, usb:?"]),
            (&[Some("1"), Some("2")], Some("3"), &["no such serial number", "usb:1, usb:2"]),
            (&[None], Some("3"), &["no such serial number", "usb:?"]),
            (&[Some("1"), Some("1")], Some("1"), &["several", "unplug"]),
        ] {
            let said = choose_serial(serials, wanted).expect_err("nothing to choose");
            for word in words {
                assert!(said.contains(word), "{said}");
            }
        }
    }

    #[test]
    fn a_stranger_with_the_same_test_id_is_no_controller() {
        assert!(is_controller(VENDOR_ID, PRODUCT_ID, Some(PRODUCT)));
        assert!(is_controller(VENDOR_ID, PRODUCT_ID, None), "a system that does not know the name");
        assert!(!is_controller(VENDOR_ID, PRODUCT_ID, Some("somebody's lamp")));
        assert!(!is_controller(VENDOR_ID, PRODUCT_ID + 1, Some(PRODUCT)));
    }
}
