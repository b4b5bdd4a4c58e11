// What stands for a session's socket on a page that is played again: the room's player, of this window or of the one
// around this frame. It has the socket's interface; nothing can be asked of it.

import { _ } from "garry/shared/language";

export function connect(path, handlers) {
  const player = window.replayPlayer ?? parent.replayPlayer;
  return {
    ...player.join(path.split("/").at(-2), handlers),
    change: () => Promise.reject(new Error(_("This is a replay."))),
    ask: () => Promise.reject(new Error(_("This is a replay."))),
    send: () => false,
    silentFor: () => 0,
    isStale: () => false,
    close() {},
  };
}
