-- Sends what a HUMS box says on to the pilot's radio, from an ArduPilot with scripting (4.5 or later).
--
-- ArduPilot gives its receiver's telemetry (FrSky passthrough, CRSF, Spektrum) its own texts only. This script repeats those of the
-- box as its own: warnings and criticals, marked HUMS as before. Copy it to APM/scripts on the autopilot's card, set SCR_ENABLE to 1,
-- and let the box send its summary through the autopilot (GS_PATH 2). A ground station then shows each of them twice.

local STATUSTEXT = 253
local COMPONENT = 191 -- MAV_COMP_ID_ONBOARD_COMPUTER
local WARNING = 4 -- MAV_SEVERITY_WARNING: what is less is not repeated
local EVERY_MS = 50

-- Where the payload of a frame begins, as scripting gives it: the checksum, and the ten bytes of a MAVLink 2 header before it.
local PAYLOAD = 13
local TEXT_BYTES = 50

mavlink:init(10, 1)
mavlink:register_rx_msgid(STATUSTEXT)

local function own_system()
  return param:get("MAV_SYSID") or param:get("SYSID_THISMAV") or 1
end

local function repeat_text(frame)
  local length, system, component = frame:byte(4), frame:byte(8), frame:byte(9)
  if component ~= COMPONENT or system ~= math.floor(own_system()) then
    return
  end
  local severity = frame:byte(PAYLOAD)
  local last = PAYLOAD + math.min(length - 1, TEXT_BYTES)
  local text = frame:sub(PAYLOAD + 1, last):match("^[^\0]*")
  if severity <= WARNING and text:sub(1, 5) == "HUMS:" then
    gcs:send_text(severity, text)
  end
end

local function update()
  local frame = mavlink:receive_chan()
  while frame do
    repeat_text(frame)
    frame = mavlink:receive_chan()
  end
  return update, EVERY_MS
end

return update()
