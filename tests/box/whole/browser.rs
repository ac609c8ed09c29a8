//! A real browser without a window, driven over its pipe: one page at a time.

use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Is there a browser? Where `CNC_GATEWAY_CI` is set there must be one; elsewhere its absence is said.
pub(crate) fn is_there() -> bool {
    let found = Command::new("chromium").arg("--version").output().is_ok_and(|output| output.status.success());
    assert!(found || std::env::var_os("CNC_GATEWAY_CI").is_none(), "no chromium: install the package of this name");
    if !found {
        eprintln!("SKIPPED: no chromium here; install the package of this name to test the page");
    }
    found
}

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: File,
    from: BufReader<File>,
    session: Option<String>,
    last: u64,
    events: Vec<Value>,
}

impl Browser {
    /// Starts one, with its profile in `directory`.
    pub(crate) fn start(directory: &Path) -> Self {
        let (to, from) = (directory.join("to"), directory.join("from"));
        for pipe in [&to, &from] {
            assert!(Command::new("mkfifo").arg(pipe).status().expect("mkfifo runs").success());
        }
        // The browser reads descriptor 3 and writes descriptor 4.
        let script = "exec chromium --headless --no-sandbox --disable-gpu --disable-dev-shm-usage --no-first-run \
                      --remote-debugging-pipe --user-data-dir=\"$1/profile\" about:blank 3<\"$1/to\" 4>\"$1/from\"";
        let mut command = Command::new("sh");
        command.args(["-c", script, "sh"]).arg(directory).stdout(Stdio::null()).stderr(Stdio::null());
        let child = command.spawn().expect("sh starts");
        let open_to = OpenOptions::new().write(true).open(to).expect("the browser opens its side");
        let open_from = File::open(from).expect("the browser opens its side");
        let mut browser =
            Self { child, to: open_to, from: BufReader::new(open_from), session: None, last: 0, events: Vec::new() };
        browser.attach();
        browser
    }

    fn attach(&mut self) {
        let target = self.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let target = target["targetId"].as_str().expect("a target").to_owned();
        let attached = self.call("Target.attachToTarget", &json!({ "targetId": target, "flatten": true }));
        self.session = attached["sessionId"].as_str().map(str::to_owned);
        self.size(1400, 1300);
        for domain in ["Runtime.enable", "Log.enable", "Network.enable", "Page.enable"] {
            self.call(domain, &json!({}));
        }
    }

    /// The window, in CSS pixels.
    pub(crate) fn size(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.call("Emulation.setDeviceMetricsOverride", &size);
    }

    /// `light` or `dark`, as the operating system would say it.
    pub(crate) fn scheme(&mut self, scheme: &str) {
        let features = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        self.call("Emulation.setEmulatedMedia", &features);
    }

    /// Runs before every document that is opened from now on.
    pub(crate) fn before_every_document(&mut self, script: &str) {
        self.call("Page.addScriptToEvaluateOnNewDocument", &json!({ "source": script }));
    }

    /// A picture of the whole page as PNG.
    pub(crate) fn picture(&mut self) -> String {
        let answer = self.call("Page.captureScreenshot", &json!({ "format": "png", "captureBeyondViewport": true }));
        answer["data"].as_str().expect("base64").to_owned()
    }

    /// A picture of what the window shows, as PNG.
    pub(crate) fn picture_of_window(&mut self) -> String {
        let answer = self.call("Page.captureScreenshot", &json!({ "format": "png" }));
        answer["data"].as_str().expect("base64").to_owned()
    }

    /// What has gone wrong in the page since this was last asked: exceptions, errors of the console, answers that are not 2xx
    /// or 3xx, requests to anything but `address`.
    pub(crate) fn faults(&mut self, address: &str) -> Vec<String> {
        self.value("0");
        let own = [format!("http://{address}/"), "blob:".to_owned(), "data:".to_owned(), "about:".to_owned()];
        let fault = |event: &Value| {
            let told = &event["params"];
            match event["method"].as_str().unwrap_or_default() {
                "Runtime.exceptionThrown" => Some(format!("exception: {}", told["exceptionDetails"])),
                "Runtime.consoleAPICalled" if told["type"] == "error" => Some(format!("console: {}", told["args"])),
                "Log.entryAdded" if told["entry"]["level"] == "error" => Some(format!("log: {}", told["entry"])),
                "Network.requestWillBeSent" => {
                    let url = told["request"]["url"].as_str().unwrap_or_default();
                    (!own.iter().any(|known| url.starts_with(known))).then(|| format!("request off the box: {url}"))
                }
                _ => None,
            }
        };
        std::mem::take(&mut self.events).iter().filter_map(fault).collect()
    }

    /// One command of the DevTools protocol and its result.
    pub(crate) fn call(&mut self, method: &str, parameters: &Value) -> Value {
        self.last += 1;
        let mut message = json!({ "id": self.last, "method": method, "params": parameters });
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let mut text = message.to_string().into_bytes();
        text.push(0);
        self.to.write_all(&text).expect("the browser listens");
        loop {
            let mut answer = Vec::new();
            self.from.read_until(0, &mut answer).expect("the browser answers");
            answer.pop();
            let answer: Value = serde_json::from_slice(&answer).expect("JSON");
            if answer["id"] == json!(self.last) {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
            self.events.push(answer);
        }
    }

    /// Opens an address.
    pub(crate) fn open(&mut self, url: &str) {
        self.call("Page.navigate", &json!({ "url": url }));
    }

    /// The value of an expression in the page; promises are awaited.
    pub(crate) fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let result = self.call("Runtime.evaluate", &parameters);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {}", result["exceptionDetails"]);
        result["result"]["value"].clone()
    }

    /// Waits until an expression is true, or anything that counts as true.
    pub(crate) fn wait_until(&mut self, expression: &str) {
        let until = Instant::now() + Duration::from_secs(90);
        let asked = format!("Boolean({expression})");
        while self.value(&asked) != json!(true) {
            assert!(
                Instant::now() < until,
                "never true: {expression}; the page says:\n{}",
                self.value("document.body.innerText")
            );
            thread::sleep(Duration::from_millis(100));
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _already_gone = self.child.kill();
        let _reaped = self.child.wait();
    }
}
