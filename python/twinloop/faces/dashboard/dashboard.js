// Looks every other second whether anything has changed, and sends what people say.
"use strict";
(() => {
  const at = document.body.dataset.at;
  if (at === undefined) return;
  const get = (id) => document.getElementById(id);
  const frame = get("report");
  let state = null, busy = false, passing = false;

  const say = (text, bad) => {
    const said = get("said");
    said.textContent = text || "";
    said.className = bad ? "bad" : "";
  };
  const send = async (path, body) => {
    say("");
    let done = false;
    passing = false;
    try {
      const answer = await fetch(at + path, { method: "POST", body });
      const found = await answer.json();
      done = answer.ok;
      passing = answer.status === 202;  // it goes on behind, and what was said of it holds only as long
      say(found.said || found.failed, !done);
    } catch (failure) {
      say("The dashboard does not answer: " + failure.message, true);
    }
    await look();
    return done;
  };
  const words = (path, what) => send(path, JSON.stringify(what));
  const log = (path, file, reason) => {
    const asked = new URLSearchParams({ file: file.name });
    if (reason) asked.set("reason", reason);
    return send(path + "?" + asked, file);
  };
  const droppable = (zone, input, take) => {
    zone.addEventListener("dragover", (event) => { event.preventDefault(); zone.classList.add("over"); });
    zone.addEventListener("dragleave", () => zone.classList.remove("over"));
    zone.addEventListener("drop", (event) => {
      event.preventDefault();
      zone.classList.remove("over");
      if (event.dataTransfer.files.length === 1) take(event.dataTransfer.files[0]);
      else say("Expected one file, found " + event.dataTransfer.files.length + ".", true);
    });
    input.addEventListener("change", () => { if (input.files.length) take(input.files[0]); input.value = ""; });
  };

  // The first cells are heads: of their row, or of their columns where all are.
  const line = (part, cells, heads) => {
    const row = part.insertRow();
    cells.forEach((text, place) => {
      const cell = document.createElement(place < heads ? "th" : "td");
      if (place < heads) cell.scope = heads === cells.length ? "col" : "row";
      cell.textContent = text;
      row.append(cell);
    });
  };
  const card = (test) => {
    const part = get("test").content.cloneNode(true), one = (name) => part.querySelector(name);
    const path = "/tests/" + test.number;
    one("h3").textContent = "Test " + test.number;
    one(".advice").hidden = !test.advice;
    one(".advice").textContent = test.advice;
    one(".unreliable").hidden = !test.unreliable;
    one(".unreliable").textContent = test.unreliable;
    one(".reason").textContent = test.reason || "";
    const rows = Object.entries(test.gains);
    if (test.predicted !== null) rows.push(["quality predicted", (test.predicted + (test.spread === null ? "" : " ± " + test.spread) + " " + test.unit).trim()]);
    rows.push(["risk of " + test.risk_of, test.risk === null ? "not estimated" : test.risk]);
    for (const [name, value] of rows) {
      line(one(".set tbody"), [name, value], 1);
    }
    const [titles, ...states] = test.ends;
    line(one(".ends thead"), titles, titles.length);
    for (const state of states) line(one(".ends tbody"), state, 1);
    one(".varies").textContent = test.varies;
    one(".varies").hidden = !test.varies;
    one(".excitation").textContent = test.excitation;
    one(".held").textContent = test.hold_back;
    one(".held").hidden = !test.hold_back;
    one(".risk").textContent = test.risk_unknown === null ? "" : "Risk of " + test.risk_of + ": " + test.risk_unknown;
    one(".risk").hidden = test.risk_unknown === null;
    one(".sheet").href = at + path + "/sheet";
    one(".columns").href = at + path + "/columns.csv";
    one(".approve").hidden = test.approved !== null;
    one(".approved").textContent = test.approved === null ? "" : "Approved " + test.approved.slice(0, 16).replace("T", " ") + " UTC";
    one(".approve").addEventListener("click", () => words(path + "/approve", {}));
    const aborted = one(".aborted"), why = one(".why");
    one(".fail").addEventListener("click", () => words(path + "/failed", { reason: why.value }));
    one(".abandon").addEventListener("click", () => words(path + "/abandon", {}));
    droppable(one(".drop"), one(".drop input[type=file]"), (file) => log(path + "/log", file, aborted.value));
    return part;
  };

  const choose = (recorded) => {
    const which = get("which"), chosen = which.value;
    which.replaceChildren(...recorded.map((flight) => new Option(flight.words, flight.which)));
    if (recorded.some((flight) => flight.which === chosen)) which.value = chosen;
    get("withdrawing").hidden = !recorded.length;
  };
  const withdraw = async () => {
    const flight = get("which").selectedOptions[0], wrong = get("wrong");
    // Without a reason nothing can be withdrawn: the answer says so.
    if (wrong.value.trim() && !confirm("Withdraw " + flight.textContent + "? Nothing is learnt from it any more; its record stays, with the reason.")) return;
    if (await words("/flights/" + flight.value + "/withdraw", { reason: wrong.value })) wrong.value = "";
  };

  const show = async () => {
    const found = await (await fetch(at + "/tests")).json();
    const cards = found.tests ? found.tests.map(card) : [];
    if (!cards.length) {
      const none = document.createElement("p");
      none.textContent = found.failed || "No test is waiting.";
      cards.push(none);
    }
    get("tests").replaceChildren(...cards);
    choose(found.recorded || []);
    get("unlearnt").textContent = found.unlearnt || "";
    if (state !== null) frame.contentWindow.location.replace(at + "/report");
  };
  const look = async () => {
    if (busy) return;
    busy = true;
    try {
      const now = await (await fetch(at + "/state")).json();
      get("ask").disabled = now.working !== null;
      get("status").textContent = now.working === null ? "Up to date." : now.working;
      if (passing && now.working === null) {
        say("");
        passing = false;
      }
      if (now.failed) say(now.failed, true);
      if (now.state !== state) {
        await show();
        state = now.state;
      }
    } catch (failure) {
      get("status").textContent = "The dashboard does not answer.";
    } finally {
      busy = false;
    }
  };

  const fit = () => {
    const page = frame.contentDocument && frame.contentDocument.documentElement;
    if (page) frame.style.height = page.scrollHeight + "px";
  };
  frame.addEventListener("load", () => {
    fit();
    new ResizeObserver(fit).observe(frame.contentDocument.body);
  });
  get("ask").addEventListener("click", () => words("/ask", { last: get("last").checked }));
  get("withdraw").addEventListener("click", withdraw);
  droppable(get("attach"), get("attached"), (file) => log("/log", file, ""));
  look();
  setInterval(look, 2000);
})();
