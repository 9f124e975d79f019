//! The MAVLink edge: framer, decoding to observations, encoding of what we send.
