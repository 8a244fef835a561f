//! The live page from outside: commands that serve it, requests to its server, stream clients
//! without a browser.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

use crate::browser::Page;
use crate::command::jointrig;

/// Runs a command that must succeed; returns its output.
#[allow(clippy::must_use_candidate, reason = "most commands are run for what they do")]
pub fn done(command: &mut Command) -> String {
    let out = command.output().unwrap();
    assert!(out.status.success(), "{command:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// Creates a campaign file with this plan in a new folder.
#[must_use]
pub fn campaign(plan: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (place, file) = (folder.path().join("plan.toml"), folder.path().join("campaign.jrig"));
    std::fs::write(&place, plan).unwrap();
    done(jointrig().args(["campaign", "new"]).arg(&file).arg("--plan").arg(&place));
    (folder, file)
}

/// Saves a screenshot of the page in the folder given by JOINTRIG_PICTURES.
pub fn picture(page: &mut Page<'_>, name: &str) {
    if let Some(folder) = std::env::var_os("JOINTRIG_PICTURES") {
        let bytes = BASE64_STANDARD.decode(page.picture()).unwrap();
        std::fs::write(Path::new(&folder).join(format!("{name}.png")), bytes).unwrap();
    }
}

/// A served live page. Dropping it ends the process.
pub struct Served {
    child: Child,
    /// The read-only address.
    pub url: String,
    /// The address for editing, if there is one.
    pub edit: Option<String>,
    rest: Option<JoinHandle<String>>,
}

impl Served {
    /// Runs `jointrig serve` for a file: read-only.
    #[must_use]
    pub fn of(file: &Path) -> Self {
        let mut child =
            jointrig().arg("serve").arg(file).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut url = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut url).unwrap();
        Self { child, url: url.trim().into(), edit: None, rest: None }
    }

    /// Runs a command that measures and prints the address of its page.
    pub fn beside(command: &mut Command) -> Self {
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let mut said = BufReader::new(child.stderr.take().unwrap());
        let mut next = |head: &str| {
            let mut line = String::new();
            while !line.starts_with(head) {
                line.clear();
                assert!(said.read_line(&mut line).unwrap() > 0, "nothing that begins with `{head}`");
            }
            line.trim().rsplit(' ').next().unwrap().to_owned()
        };
        let url = next("live page: ");
        let edit = command.get_args().all(|argument| argument != "serve").then(|| next("to take notes"));
        let rest = std::thread::spawn(move || {
            let mut rest = String::new();
            // output that cannot be read counts as empty
            let _ = said.read_to_string(&mut rest);
            rest
        });
        Self { child, url, edit, rest: Some(rest) }
    }

    /// Waits for its end: exit status, and the output since the start.
    pub fn wait(&mut self) -> (ExitStatus, String) {
        let status = self.child.wait().unwrap();
        (status, self.rest.take().map_or_else(String::new, |rest| rest.join().unwrap()))
    }

    /// Its process.
    #[must_use]
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Its port.
    #[must_use]
    pub fn port(&self) -> u16 {
        let address = self.url.strip_prefix("http://127.0.0.1:").unwrap();
        address.split('/').next().unwrap().parse().unwrap()
    }

    /// The secret of the read-only address.
    #[must_use]
    pub fn token(&self) -> &str {
        self.url.split("#look=").nth(1).unwrap()
    }

    /// The secret of the editing address.
    #[must_use]
    pub fn edit_token(&self) -> &str {
        self.edit.as_deref().unwrap().split("#edit=").nth(1).unwrap()
    }

    /// Status and body of the response to a GET request with these headers.
    #[must_use]
    pub fn asked(&self, path: &str, headers: &[(&str, &str)]) -> (u16, String) {
        self.try_asking("GET", path, headers, "").unwrap()
    }

    /// Status and body of the response to a POST request with this token and additional headers.
    #[must_use]
    pub fn wanted(&self, path: &str, token: &str, more: &[(&str, &str)], body: &str) -> (u16, String) {
        let host = format!("127.0.0.1:{}", self.port());
        let (token, length) = (format!("Bearer {token}"), body.len().to_string());
        let mut headers = vec![
            ("Host", host.as_str()),
            ("Authorization", token.as_str()),
            ("Content-Type", "application/json"),
            ("Content-Length", length.as_str()),
        ];
        headers.extend(more);
        self.try_asking("POST", path, &headers, body).unwrap()
    }

    /// Status and body of the response, for a server that may have ended.
    ///
    /// # Errors
    /// The server has ended.
    pub fn try_asking(
        &self,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
        body: &str,
    ) -> std::io::Result<(u16, String)> {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port()))?;
        stream.set_read_timeout(Some(Duration::from_secs(20)))?;
        let lines: Vec<String> = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
        write!(stream, "{method} {path} HTTP/1.1\r\n{}Connection: close\r\n\r\n{body}", lines.concat())?;
        let mut answer = String::new();
        stream.read_to_string(&mut answer)?;
        let status = answer.split(' ').nth(1).map_or(0, |status| status.parse().unwrap());
        Ok((status, answer.split_once("\r\n\r\n").map_or_else(String::new, |(_, body)| body.into())))
    }

    /// Opens a stream client without a browser.
    #[must_use]
    pub fn listener(&self) -> Listener {
        let stream = TcpStream::connect(("127.0.0.1", self.port())).unwrap();
        let (mut socket, _) =
            tungstenite::client(format!("ws://127.0.0.1:{}/socket", self.port()), stream).unwrap();
        let hello = format!("{{\"token\":\"{}\",\"stream\":true}}", self.token());
        socket.send(Message::Text(hello.into())).unwrap();
        Listener { socket, frames: 0, words: Vec::new(), missed: 0 }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // it may already have ended, which the test has noticed by then
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A stream client without a browser.
pub struct Listener {
    socket: WebSocket<TcpStream>,
    /// Number of stream frames received.
    pub frames: u64,
    /// Messages received.
    pub words: Vec<String>,
    /// Number of frames that the server reported as missed.
    pub missed: u32,
}

impl Listener {
    /// Listens until the server ends, and acknowledges every frame.
    #[must_use]
    pub fn to_the_end(mut self) -> Self {
        while let Ok(message) = self.socket.read() {
            match message {
                Message::Binary(frame) => {
                    self.frames += 1;
                    self.missed = u32::from_le_bytes(frame[20..24].try_into().unwrap());
                    let had = format!("{{\"frames\":{}}}", self.frames);
                    if self.socket.send(Message::Text(had.into())).is_err() {
                        break;
                    }
                }
                Message::Text(word) => self.words.push(word.to_string()),
                _ => {}
            }
        }
        self
    }
}
