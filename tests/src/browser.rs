//! A browser for the tests: headless Chromium connected by pipes, with a small DevTools client.
//!
//! Pipes need no port and no network. Chromium reads commands from file descriptor 3 and writes
//! replies to descriptor 4; each message is one JSON text that ends with a zero byte. Two named
//! pipes are used, so that no unsafe code is needed to pass the descriptors.

use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Names of the program in different distributions.
const PROGRAMS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// A running browser.
pub struct Browser {
    child: Child,
    to: File,
    from: BufReader<File>,
    last: u64,
    events: Vec<Value>,
    // its profile and pipes; deleted with it
    folder: TempDir,
}

/// Window and settings with which a page is opened.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Width of the window, px.
    pub width: u32,
    /// Height of the window, px.
    pub height: u32,
    /// Whether the system uses a dark colour scheme.
    pub dark: bool,
    /// Whether scripts are enabled.
    pub scripts: bool,
}

impl Look {
    /// A desktop window, light.
    pub const DESK: Look = Look { width: 1440, height: 900, dark: false, scripts: true };
    /// A phone's window, light.
    pub const HAND: Look = Look { width: 400, height: 800, dark: false, scripts: true };
}

/// An open page.
pub struct Page<'b> {
    browser: &'b mut Browser,
    session: String,
    target: String,
}

impl Browser {
    /// Starts it; `cargo xtask setup` installs the package.
    pub fn start() -> Browser {
        let folder = tempfile::tempdir().unwrap();
        let (input, output) = (folder.path().join("in"), folder.path().join("out"));
        assert!(Command::new("mkfifo").arg(&input).arg(&output).status().unwrap().success());
        let program = PROGRAMS
            .into_iter()
            .find(|name| {
                Command::new(name)
                    .arg("--version")
                    .stdout(Stdio::null())
                    .stderr(Stdio::null())
                    .status()
                    .is_ok()
            })
            .expect("no Chromium here: `cargo xtask setup` installs it");
        let child = Command::new("sh")
            .arg("-c")
            .arg("exec \"$0\" \"$@\" 3<\"$JOINTRIG_IN\" 4>\"$JOINTRIG_OUT\"")
            .arg(program)
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"])
            .args([
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-dev-shm-usage",
                "--remote-debugging-pipe",
            ])
            .arg(format!("--user-data-dir={}", folder.path().join("profile").display()))
            .arg("about:blank")
            .env("JOINTRIG_IN", &input)
            .env("JOINTRIG_OUT", &output)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // each of these blocks until the shell has opened the other end
        let to = OpenOptions::new().write(true).open(&input).unwrap();
        let from = BufReader::new(File::open(&output).unwrap());
        Browser { child, to, from, last: 0, events: Vec::new(), folder }
    }

    /// Sends a command and returns its reply. Events that arrive meanwhile are kept.
    #[allow(clippy::needless_pass_by_value, reason = "every caller makes them on the spot")]
    fn call(&mut self, session: Option<&str>, method: &str, params: Value) -> Value {
        self.last += 1;
        let id = self.last;
        let mut message = json!({ "id": id, "method": method, "params": params });
        if let Some(session) = session {
            message["sessionId"] = session.into();
        }
        let mut bytes = serde_json::to_vec(&message).unwrap();
        bytes.push(0);
        self.to.write_all(&bytes).unwrap();
        loop {
            let mut answer = Vec::new();
            self.from.read_until(0, &mut answer).unwrap();
            assert_eq!(answer.pop(), Some(0), "the browser is gone");
            let mut answer: Value = serde_json::from_slice(&answer).unwrap();
            if answer["id"] == id {
                assert!(answer.get("error").is_none(), "{method}: {}", answer["error"]);
                return answer["result"].take();
            }
            self.events.push(answer);
        }
    }

    /// Opens a file and waits until it has been drawn.
    pub fn open(&mut self, file: &Path, look: Look) -> Page<'_> {
        self.open_url(&format!("file://{}", file.canonicalize().unwrap().display()), look)
    }

    /// Opens an address and waits until it has been drawn.
    pub fn open_url(&mut self, url: &str, look: Look) -> Page<'_> {
        self.events.clear();
        let target = self.call(None, "Target.createTarget", json!({ "url": "about:blank" }))["targetId"]
            .as_str()
            .unwrap()
            .to_owned();
        let attach = json!({ "targetId": target, "flatten": true });
        let session =
            self.call(None, "Target.attachToTarget", attach)["sessionId"].as_str().unwrap().to_owned();
        let mut page = Page { browser: self, session, target };
        for domain in ["Page", "Runtime", "Log", "Network"] {
            page.call(&format!("{domain}.enable"), json!({}));
        }
        page.resize(look.width, look.height);
        let light = if look.dark { "dark" } else { "light" };
        page.call(
            "Emulation.setEmulatedMedia",
            json!({ "features": [{ "name": "prefers-color-scheme", "value": light }] }),
        );
        page.call("Emulation.setScriptExecutionDisabled", json!({ "value": !look.scripts }));
        page.call("Page.navigate", json!({ "url": url }));
        page.until("location.href !== 'about:blank' && document.readyState === 'complete'");
        page.call("Emulation.setFocusEmulationEnabled", json!({ "enabled": true }));
        page
    }

    /// The folder of its profile, which a test may also use for downloads.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // the browser may already have ended, which is not an error here
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Page<'_> {
    fn call(&mut self, method: &str, params: Value) -> Value {
        let session = self.session.clone();
        self.browser.call(Some(&session), method, params)
    }

    /// Puts the page behind another tab, or back in front.
    pub fn hide(&mut self, hidden: bool) {
        self.call("Emulation.setFocusEmulationEnabled", json!({ "enabled": !hidden }));
        let front = if hidden {
            let blank = json!({ "url": "about:blank" });
            self.browser.call(None, "Target.createTarget", blank)["targetId"].as_str().unwrap().to_owned()
        } else {
            self.target.clone()
        };
        self.browser.call(None, "Target.activateTarget", json!({ "targetId": front }));
        self.until(&format!("document.hidden === {hidden}"));
    }

    /// Changes the size of the window, px.
    pub fn resize(&mut self, width: u32, height: u32) {
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", metrics);
    }

    /// The value of an expression; waits for a promise.
    pub fn eval(&mut self, expression: &str) -> Value {
        let ask = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let mut answer = self.call("Runtime.evaluate", ask);
        assert!(answer.get("exceptionDetails").is_none(), "{expression}: {}", answer["exceptionDetails"]);
        answer["result"]["value"].take()
    }

    /// Waits until the expression is true. On a loaded machine an analysis alone takes half a
    /// minute.
    pub fn until(&mut self, expression: &str) {
        let end = Instant::now() + Duration::from_mins(2);
        while self.eval(expression) != Value::Bool(true) {
            assert!(Instant::now() < end, "never came true: {expression}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Drags the mouse from one position in the window to another.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        let middle = [f64::midpoint(from[0], to[0]), f64::midpoint(from[1], to[1])];
        self.mouse("mouseMoved", from, 0);
        self.mouse("mousePressed", from, 1);
        for at in [middle, to] {
            self.mouse("mouseMoved", at, 1);
        }
        self.mouse("mouseReleased", to, 1);
    }

    /// Clicks, once or twice.
    pub fn click(&mut self, at: [f64; 2], times: u32) {
        self.mouse("mouseMoved", at, 0);
        for count in 1..=times {
            for kind in ["mousePressed", "mouseReleased"] {
                let params = json!({ "type": kind, "x": at[0], "y": at[1], "button": "left", "buttons": 1, "clickCount": count });
                self.call("Input.dispatchMouseEvent", params);
            }
        }
    }

    /// Turns the wheel; negative zooms in.
    pub fn wheel(&mut self, at: [f64; 2], by: f64) {
        let params = json!({ "type": "mouseWheel", "x": at[0], "y": at[1], "deltaX": 0, "deltaY": by });
        self.call("Input.dispatchMouseEvent", params);
    }

    fn mouse(&mut self, kind: &str, at: [f64; 2], buttons: u32) {
        let button = if buttons == 0 { "none" } else { "left" };
        let params = json!({ "type": kind, "x": at[0], "y": at[1], "button": button, "buttons": buttons, "clickCount": 1 });
        self.call("Input.dispatchMouseEvent", params);
    }

    /// Presses and releases a key.
    pub fn key(&mut self, key: &str) {
        let text = if key.chars().count() == 1 { key } else { "" };
        for kind in ["keyDown", "keyUp"] {
            self.call(
                "Input.dispatchKeyEvent",
                json!({ "type": kind, "key": key, "text": if kind == "keyDown" { text } else { "" } }),
            );
        }
    }

    /// A performance metric of the browser, such as `TaskDuration` (s of the page's main thread).
    pub fn metric(&mut self, name: &str) -> f64 {
        self.call("Performance.enable", json!({}));
        let metrics = self.call("Performance.getMetrics", json!({}));
        let own = metrics["metrics"].as_array().unwrap().iter().find(|metric| metric["name"] == name);
        own.unwrap()["value"].as_f64().unwrap()
    }

    /// A screenshot of the window as a PNG file in base64.
    pub fn picture(&mut self) -> String {
        self.call("Page.captureScreenshot", json!({}))["data"].as_str().unwrap().to_owned()
    }

    /// The page printed, as a PDF file in base64.
    pub fn pdf(&mut self) -> String {
        let how = json!({ "preferCSSPageSize": true, "printBackground": true });
        self.call("Page.printToPDF", how)["data"].as_str().unwrap().to_owned()
    }

    /// All errors so far: exceptions, console messages, violations of the content security policy.
    pub fn errors(&mut self) -> Vec<String> {
        self.eval("0");
        let wrong = ["Runtime.exceptionThrown", "Log.entryAdded", "Runtime.consoleAPICalled"];
        let events = self.browser.events.iter().filter(|e| wrong.iter().any(|method| e["method"] == *method));
        events.map(|e| e["params"].to_string()).collect()
    }

    /// All requests to disk or network, except for the page itself and data URLs.
    pub fn requests(&mut self) -> Vec<String> {
        self.eval("0");
        let asked = self.browser.events.iter().filter(|e| e["method"] == "Network.requestWillBeSent");
        let urls = asked.filter_map(|e| e["params"]["request"]["url"].as_str().map(str::to_owned));
        let own = self
            .browser
            .events
            .iter()
            .find_map(|e| e["params"]["documentURL"].as_str())
            .unwrap_or_default()
            .to_owned();
        urls.filter(|url| *url != own && !url.starts_with("data:") && !url.starts_with("blob:")).collect()
    }
}

impl Drop for Page<'_> {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            let target = self.target.clone();
            self.browser.call(None, "Target.closeTarget", json!({ "targetId": target }));
        }
    }
}
