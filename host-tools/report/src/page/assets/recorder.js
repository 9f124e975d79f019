// The recorder itself: sizes, gaps, losses.

import { data, log } from "./data.js";
import { el } from "./elements.js";
import { flight } from "./flight.js";
import { cells, facts, rows, section } from "./layout.js";
import { bytes, fixed, moment, plural, whole, words } from "./text.js";

export const recorderSection = () => {
  const recorder = section("recorder", "Recorder");
  const stats = data.stats;
  // Frames missing, records, sectors and an ending are known of a log of HUMS only.
  const own = log.format === "hums";
  const missing = log.gaps_uncounted ? `at least ${whole(log.frames_missing + log.gaps_uncounted)}` : whole(log.frames_missing);
  const part = stats?.queue_bytes_capacity ? fixed((stats.queue_bytes_max / stats.queue_bytes_capacity) * 100, 0) : null;
  recorder.append(
    el(
      "div",
      { class: "split" },
      el(
        "div",
        { class: "panel" },
        facts([
          ["Frames", own ? `${whole(log.frames)} recorded, ${missing} missing` : log.frames ? whole(log.frames) : null],
          ["Records", own ? whole(log.records) : null],
          [
            "Size",
            own
              ? `${bytes(log.log_bytes)}; as a tlog ${bytes(log.tlog_bytes)}: ${fixed(log.ratio, 2)} times smaller`
              : bytes(log.bytes_on_card),
          ],
          ["Sectors", own ? `${whole(log.sectors)}, ${whole(log.sectors_damaged)} damaged` : null],
          ["Ending", log.end?.words],
          [
            data.counted_until_s == null ? "Received" : `Received until ${moment(data.counted_until_s - flight.zero)}`,
            stats && `${whole(stats.frames_in)} frames, ${bytes(stats.bytes_in)}, of which ${bytes(stats.bytes_not_frames)} were no frame`,
          ],
          ["Queue, fullest", part && `${bytes(stats.queue_bytes_max)} of ${bytes(stats.queue_bytes_capacity)} (${part} %)`],
          ["Card, longest stall", stats && `${whole(stats.sd_stall_ms_max)} ms`],
          ["To the ground station", stats && `${whole(stats.gs_frames)} frames, ${bytes(stats.gs_bytes)}`],
          [
            "Not sent, ports full",
            stats &&
              `${plural(stats.gs_frames_lost, "frame")} to the ground station, ${whole(stats.autopilot_frames_lost)} to the autopilot, ` +
                `${whole(stats.passed_frames_lost)} of others`,
          ],
          ["Refused for their signature", stats && plural(stats.requests_refused, "request")],
        ]),
      ),
      el(
        "div",
        { class: "panel scroll" },
        log.gaps.length || log.losses.length
          ? rows(
              [["What"], ["From", "n"], ["To", "n"], ["How much", "n"]],
              [
                ...log.gaps.map((g) =>
                  cells(
                    [
                      own ? `gap: ${g.cause}, ${plural(g.sectors_lost + g.sectors_skipped, "sector")}` : `gap: ${g.cause}`,
                      g.from_s == null ? "the beginning" : moment(g.from_s - flight.zero),
                      g.to_s == null ? (own ? "the end" : "") : moment(g.to_s - flight.zero),
                      g.frames_missing == null ? "unknown" : plural(g.frames_missing, "frame"),
                    ],
                    ["", "n", "n", "n"],
                    { class: "gap" },
                  ),
                ),
                ...log.losses.map((l) =>
                  cells(
                    [`lost: ${words(l.what)}`, moment(l.from_s - flight.zero), moment(l.to_s - flight.zero), whole(l.count)],
                    ["", "n", "n", "n"],
                  ),
                ),
              ],
            )
          : el(
              "p",
              { class: "ok" },
              own ? "No gap, no loss: every frame that arrived is here." : "No gap and no damage was found in the file.",
            ),
        log.gaps_count > log.gaps.length ? el("p", { class: "dim" }, `and ${whole(log.gaps_count - log.gaps.length)} more gaps`) : null,
      ),
    ),
  );
};
