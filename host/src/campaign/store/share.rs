//! Network shares: SQLite's write-ahead log needs memory shared between processes, which network
//! file systems do not provide.

use std::path::Path;

use super::error::StoreError;

/// Network file systems, by their names in Linux's mount table; these may have the prefix `fuse.`.
const NETWORK: [&str; 22] = [
    "9p",
    "afs",
    "afpfs",
    "ceph",
    "cifs",
    "coda",
    "davfs",
    "drvfs",
    "glusterfs",
    "gvfsd-fuse",
    "lustre",
    "ncpfs",
    "nfs",
    "nfs4",
    "ocfs2",
    "rclone",
    "s3fs",
    "smb2",
    "smb3",
    "smbfs",
    "sshfs",
    "virtiofs",
];

/// Refuses to write a campaign on a network share. Only Linux provides a mount table; on other
/// systems nothing is refused.
pub(super) fn refuse(campaign: &Path) -> Result<(), StoreError> {
    let folder = campaign.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (Ok(table), Ok(folder)) = (std::fs::read_to_string("/proc/self/mountinfo"), folder.canonicalize())
    else {
        return Ok(());
    };
    match network(&table, &folder) {
        Some(kind) => Err(StoreError::Share { path: campaign.into(), kind }),
        None => Ok(()),
    }
}

/// The kind of file system under `folder`, if it is a network file system. `table` is Linux's
/// `mountinfo`.
fn network(table: &str, folder: &Path) -> Option<String> {
    let mounts = table.lines().filter_map(|line| {
        // "36 35 98:0 / /mnt rw,noatime shared:1 - ext3 /dev/root rw"
        let (before, after) = line.split_once(" - ")?;
        let point = unescaped(before.split(' ').nth(4)?);
        Some((point, after.split(' ').next()?.to_owned()))
    });
    // the longest mount point applies, and the last one mounted there
    let (_, kind) =
        mounts.filter(|(point, _)| folder.starts_with(point)).max_by_key(|(point, _)| point.len())?;
    NETWORK.contains(&kind.trim_start_matches("fuse.")).then_some(kind)
}

/// Decodes space, tab, newline and backslash, which the kernel writes as octal numbers.
fn unescaped(text: &str) -> String {
    [("\\040", " "), ("\\011", "\t"), ("\\012", "\n"), ("\\134", "\\")]
        .into_iter()
        .fold(text.to_owned(), |text, (code, character)| text.replace(code, character))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "22 1 254:0 / / rw,relatime - ext4 /dev/vda rw\n\
                         40 22 0:40 / /home rw - nfs4 server:/home rw,vers=4.2\n\
                         41 40 0:41 / /home/me/lab\\040disk rw shared:5 - ext4 /dev/sdb rw\n\
                         42 22 0:42 / /mnt/share rw - cifs //server/x rw\n\
                         43 22 0:43 / /mnt/ssh rw - fuse.sshfs me@there:/ rw\n";

    #[test]
    fn the_file_system_that_counts_is_the_innermost() {
        let of = |folder: &str| network(TABLE, Path::new(folder));
        assert_eq!(of("/var/data"), None);
        assert_eq!(of("/home/me").as_deref(), Some("nfs4"));
        assert_eq!(of("/home/me/lab disk/2026"), None);
        assert_eq!(of("/mnt/share").as_deref(), Some("cifs"));
        assert_eq!(of("/mnt/sharedisk"), None);
        assert_eq!(of("/mnt/ssh/x").as_deref(), Some("fuse.sshfs"));
    }
}
