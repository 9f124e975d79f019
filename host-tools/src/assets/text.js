// Numbers, times and names as text.

// Thousands apart, by a narrow space that does not break.
export const grouped = (text) => text.replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");

export const digits = (value, decimals) => {
  const [before, after] = Number(value).toFixed(decimals).replace(/^-(?=[0.]*$)/, "").split(".");
  return grouped(before) + (after ? "." + after : "");
};

// Whole seconds as 1:02:03, or 2:03.
export const hours = (s) => {
  const two = (n) => String(n).padStart(2, "0");
  return s >= 3600 ? `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)}` : `${Math.floor(s / 60)}:${two(s % 60)}`;
};

export const words = (name) => name.replace(/_/g, " ");
