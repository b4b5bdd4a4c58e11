// Two therapists' pages beside each other: one whose session has ended gives way to a link.

for (const frame of document.querySelectorAll("iframe")) {
  frame.addEventListener("load", () => {
    let isMonitor = false;
    try {
      isMonitor = frame.contentWindow.location.pathname.endsWith("/monitor/");
    } catch {
      // what it leads to is not shown in frames
    }
    frame.hidden = !isMonitor;
    frame.nextElementSibling.hidden = isMonitor;
  });
}
