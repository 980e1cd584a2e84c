// Formats numbers for people.
const byteUnits = ['B', 'kB', 'MB', 'GB', 'TB'];

export function bytesText(bytes: number | bigint): string {
  let value = Number(bytes);
  let unit = 0;
  for (; value >= 999.5 && unit < byteUnits.length - 1; ++unit) value /= 1000;
  const digits = unit === 0 || value >= 100 ? 0 : 1;
  return `${value.toFixed(digits)} ${byteUnits[unit]}`;
}

export function durationText(seconds: number): string {
  const whole = Math.max(0, Math.round(seconds));
  if (whole < 60) return `${whole} s`;
  const minutes = Math.floor(whole / 60);
  if (minutes < 60) return `${minutes} min ${whole % 60} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

export function countText(count: number | bigint): string {
  return Number(count).toLocaleString('en');
}

/** Returns a device in plain words: "cpu (2 threads, AVX3)" -> "the CPU (2 threads)". */
export function deviceText(device: string): string {
  return device
    .replace(/^cpu \((\d+ threads?)\b.*\)$/, 'the CPU ($1)')
    .replace(/^cuda \d+ \((.+)\)$/, 'the GPU ($1)');
}

interface Seconds {
  readonly seconds: bigint;
  readonly nanos: number;
}

/** Returns the seconds of a Duration or a Timestamp. */
export function secondsOf(time: Seconds | undefined): number {
  return time ? Number(time.seconds) + time.nanos * 1e-9 : 0;
}

export function dateText(time: Seconds | undefined): string {
  if (!time) return '';
  const format = { dateStyle: 'medium', timeStyle: 'short' } as const;
  return new Intl.DateTimeFormat('en', format).format(secondsOf(time) * 1000);
}
