#pragma once

#include <cstdint>

#include "kernels/math/blend.h"

// The scale gate of stage two (METHOD.md section 3), channel by channel. s is a query scale in
// [0, 2], psi in (0, 1). With one layer
//   psi(s) = sigmoid(W s + b),
// with two layers, of which the first has kGateHidden units,
//   h(s) = max(0, W1 s + b1),  psi(s) = sigmoid(W2 h(s) + b2).

namespace pepeseg {

inline constexpr int kGateHidden = 32;

// Numbers of a gate of `count` channels: W[count], b[count]; or W1[kGateHidden], b1[kGateHidden],
// W2[kGateHidden, count], b2[count]. Which of the two follows from the size.
template <class T>
struct GateNumbers {
  const T* data;
  int64_t size;
};
PEPESEG_HD constexpr int OneLayerGateSize(int count) { return 2 * count; }
PEPESEG_HD constexpr int TwoLayerGateSize(int count) {
  return 2 * kGateHidden + (kGateHidden + 1) * count;
}
PEPESEG_HD constexpr bool HasTwoLayers(int64_t size, int count) {
  return size == TwoLayerGateSize(count);
}

// One channel of psi(s), with one layer.
template <class T>
PEPESEG_HD T Gate(T weight, T bias, T scale) {
  return Sigmoid(MulAdd(weight, scale, bias));
}
// Gradient of the bias of a channel, from that of psi. The gradient of its weight is `scale` times
// as large. With two layers it is that of b2.
template <class T>
PEPESEG_HD T GateVjp(T psi, T psi_grad) {
  return SigmoidVjp(psi, psi_grad);
}

// Unit j of h(s) of a gate of two layers.
template <class T>
PEPESEG_HD T HiddenUnit(const T* gate, int j, T scale) {
  return Max(T(0), MulAdd(gate[j], scale, gate[kGateHidden + j]));
}
// One channel of psi(s), with either number of layers.
template <class T>
PEPESEG_HD T GateChannel(GateNumbers<T> gate, int count, int channel, T scale) {
  if (!HasTwoLayers(gate.size, count)) {
    return Gate(gate.data[channel], gate.data[count + channel], scale);
  }
  const T* weights = gate.data + 2 * kGateHidden;
  T sum = weights[kGateHidden * count + channel];
  for (int j = 0; j < kGateHidden; ++j) {
    sum = MulAdd(HiddenUnit(gate.data, j, scale), weights[j * count + channel], sum);
  }
  return Sigmoid(sum);
}

// Writes psi[count] at one scale.
template <class T>
PEPESEG_HD void GateAt(GateNumbers<T> gate, int count, T scale, T* psi) {
  for (int k = 0; k < count; ++k) psi[k] = GateChannel(gate, count, k, scale);
}

// Adds the gradients of hidden unit j: of row j of W2, and, through h, of W1 and b1. bias_grad:
// those of b2 at this scale.
template <class T>
PEPESEG_HD void HiddenUnitVjp(const T* gate, int j, int count, T scale, const T* bias_grad,
                              T* gate_grad) {
  const T hidden = HiddenUnit(gate, j, scale);
  const int row = 2 * kGateHidden + j * count;
  T hidden_grad = T(0);
  for (int k = 0; k < count; ++k) {
    hidden_grad = MulAdd(gate[row + k], bias_grad[k], hidden_grad);
    gate_grad[row + k] = MulAdd(hidden, bias_grad[k], gate_grad[row + k]);
  }
  if (!(T(0) < hidden)) return;
  gate_grad[j] = MulAdd(scale, hidden_grad, gate_grad[j]);
  gate_grad[kGateHidden + j] += hidden_grad;
}
// Adds the gradients of the gate's numbers, from that of psi at one scale, to gate_grad, which is
// laid out as the gate. Overwrites psi_grad[count] with the gradients of the outer biases.
template <class T>
PEPESEG_HD void GateAtVjp(GateNumbers<T> gate, int count, T scale, T* psi_grad, T* gate_grad) {
  for (int k = 0; k < count; ++k) {
    psi_grad[k] = GateVjp(GateChannel(gate, count, k, scale), psi_grad[k]);
  }
  const bool two = HasTwoLayers(gate.size, count);
  T* outer_bias_grad = gate_grad + (two ? 2 * kGateHidden + kGateHidden * count : count);
  for (int k = 0; k < count; ++k) {
    if (!two) gate_grad[k] = MulAdd(scale, psi_grad[k], gate_grad[k]);
    outer_bias_grad[k] += psi_grad[k];
  }
  for (int j = 0; two && j < kGateHidden; ++j) {
    HiddenUnitVjp(gate.data, j, count, scale, psi_grad, gate_grad);
  }
}

}  // namespace pepeseg
