import { expect, test } from '@playwright/test';
import { bytesText, deviceText, durationText } from '../../app/format';

test('devices are in plain words, and unknown ones as the server names them', () => {
  expect(deviceText('cpu (2 threads, N_AVX3)')).toBe('the CPU (2 threads)');
  expect(deviceText('cpu (1 thread, AVX2)')).toBe('the CPU (1 thread)');
  expect(deviceText('cuda 0 (NVIDIA H100 80GB)')).toBe('the GPU (NVIDIA H100 80GB)');
  expect(deviceText('metal')).toBe('metal');
});

test('bytes and durations are rounded to what a person reads', () => {
  expect([999, 1000, 12_340, 999_600_000].map(bytesText)).toEqual([
    '999 B',
    '1.0 kB',
    '12.3 kB',
    '1.0 GB',
  ]);
  expect([59.4, 61, 3661].map(durationText)).toEqual(['59 s', '1 min 1 s', '1 h 1 min']);
});
