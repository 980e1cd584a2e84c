#include "tests/kernels/pair_reference.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "kernels/math/feature.h"
#include "kernels/math/gate.h"

namespace pepeseg {
namespace {

constexpr int kSize = kFeatureSize;

// G at a scale.
bool Agree(const PairBatch& batch, int scale, int p, int q) {
  const int words = batch.label_words;
  for (int w = 0; w < words; ++w) {
    const uint64_t a = batch.labels[(scale * batch.num_cells + batch.cell[p]) * words + w];
    const uint64_t b = batch.labels[(scale * batch.num_cells + batch.cell[q]) * words + w];
    if ((a & b) != 0) return true;
  }
  return false;
}

std::vector<double> Psi(const PairBatch& batch, int scale) {
  std::vector<double> psi(kSize);
  if (batch.gate.size() == kTwoLayerGateSize) {
    GateAt(GateNumbers<double>{batch.gate.data(), kTwoLayerGateSize}, kSize, batch.scales[scale],
           psi.data());
    return psi;
  }
  for (int k = 0; k < kSize; ++k) {
    const double x = batch.gate[k] * batch.scales[scale] + batch.gate[kSize + k];
    psi[k] = 1 / (1 + std::exp(-x));
  }
  return psi;
}

double Cosine(const PairBatch& batch, const std::vector<double>& psi, int p, int q) {
  double pq = 0, pp = 0, qq = 0;
  for (int k = 0; k < kSize; ++k) {
    const double a = psi[k] * batch.features[p * kSize + k];
    const double b = psi[k] * batch.features[q * kSize + k];
    pq += a * b;
    pp += a * a;
    qq += b * b;
  }
  return pq / std::sqrt((pp + 1e-12) * (qq + 1e-12));
}

// Whether a pair counts: it is hard or wrong at some scale.
bool Counts(const PairBatch& batch, const std::vector<double>& cosines, int p, int q) {
  if (batch.every_pair) return true;
  int agreeing = 0;
  bool violates = false;
  for (int scale = 0; scale < batch.num_scales; ++scale) {
    const bool agree = Agree(batch, scale, p, q);
    agreeing += agree;
    violates |= agree ? cosines[scale] < 0.75 : cosines[scale] > 0.5;
  }
  return violates || (agreeing > 0 && agreeing < batch.num_scales);
}

// The product of the weights, min-max normalised over all pairs to [1, 10].
double PairWeight(const PairBatch& batch, int p, int q) {
  double low = 1e300, high = -1e300;
  for (int i = 0; i < batch.num_pixels; ++i) {
    for (int j = 0; j < i; ++j) {
      low = std::min(low, batch.weight[i] * batch.weight[j]);
      high = std::max(high, batch.weight[i] * batch.weight[j]);
    }
  }
  if (high == low) return 1;
  return 1 + 9 * (batch.weight[p] * batch.weight[q] - low) / (high - low);
}

// Adds the gradient of a cosine with respect to one pixel of its pair, p.
void AddCosineGrad(const PairBatch& batch, const std::vector<double>& psi, int p, int q,
                   double cosine_grad, PairReference& out, std::vector<double>& psi_grad) {
  std::vector<double> unit(kSize);
  GatedUnit(psi.data(), &batch.features[q * kSize], kSize, unit.data());
  for (double& u : unit) u *= cosine_grad;
  GatedUnitVjp(psi.data(), &batch.features[p * kSize], kSize, unit.data(),
               &out.feature_grad[p * kSize], psi_grad.data());
}

// A pair at one scale.
struct Term {
  int scale, p, q;
  double cosine_grad;  // d sum / d cosine, for the sum that the term is in
  bool positive;
};

// Adds sums and counts of all pairs, and returns their terms. Gradients need the final counts.
std::vector<Term> AddPairs(const PairBatch& batch, PairReference& out) {
  std::vector<Term> terms;
  std::vector<std::vector<double>> psi;
  psi.reserve(batch.num_scales);
  for (int scale = 0; scale < batch.num_scales; ++scale) psi.push_back(Psi(batch, scale));
  for (int q = 0; q < batch.num_pixels; ++q) {
    for (int p = 0; p < q; ++p) {
      std::vector<double> cosines;
      cosines.reserve(psi.size());
      for (const auto& at_scale : psi) cosines.push_back(Cosine(batch, at_scale, p, q));
      if (!Counts(batch, cosines, p, q)) continue;
      const double w = PairWeight(batch, p, q);
      for (int scale = 0; scale < batch.num_scales; ++scale) {
        const double c = cosines[scale];
        const bool agree = Agree(batch, scale, p, q);
        const double margin = double{batch.negative_margin};
        (agree ? out.positive_loss : out.negative_loss) +=
            agree ? -w * c : w * std::max(c - margin, 0.0);
        (agree ? out.num_positives : out.num_negatives) += 1;
        terms.push_back(
            {scale, p, q, agree ? PositiveTermVjp(w) : NegativeTermVjp(w, c, margin), agree});
      }
    }
  }
  return terms;
}

// Adds the norm term of pixels and its gradient.
void AddNorms(const PairBatch& batch, PairReference& out) {
  const auto counts = [](double alpha) { return alpha > 0.9; };
  out.num_norm_pixels =
      static_cast<double>(std::count_if(batch.alpha.begin(), batch.alpha.end(), counts));
  for (int p = 0; p < batch.num_pixels; ++p) {
    if (!counts(batch.alpha[p])) continue;
    const double* f = &batch.features[p * kSize];
    double squares = 0;
    for (int k = 0; k < kSize; ++k) squares += f[k] * f[k];
    out.norm_loss += std::pow(std::sqrt(squares + 1e-12) - 1, 2);
    const double pull = NormTermVjp(f, kSize, 1 / out.num_norm_pixels);
    for (int k = 0; k < kSize; ++k) out.feature_grad[p * kSize + k] += pull * f[k];
  }
}

}  // namespace

PairReference ComputePairReference(const PairBatch& batch) {
  PairReference out;
  out.joint_mean = batch.joint_mean;
  out.feature_grad.resize(batch.features.size());
  out.gate_grad.resize(batch.gate.size());
  std::vector<std::vector<double>> psi_grad(batch.num_scales, std::vector<double>(kSize));
  for (const Term& t : AddPairs(batch, out)) {
    const double count = batch.joint_mean ? out.num_positives + out.num_negatives
                         : t.positive     ? out.num_positives
                                          : out.num_negatives;
    const double grad = t.cosine_grad / count;
    const std::vector<double> psi = Psi(batch, t.scale);
    AddCosineGrad(batch, psi, t.p, t.q, grad, out, psi_grad[t.scale]);
    AddCosineGrad(batch, psi, t.q, t.p, grad, out, psi_grad[t.scale]);
  }
  for (int scale = 0; scale < batch.num_scales; ++scale) {
    if (batch.gate.size() == kTwoLayerGateSize) {
      GateAtVjp(GateNumbers<double>{batch.gate.data(), kTwoLayerGateSize}, kSize,
                batch.scales[scale], psi_grad[scale].data(), out.gate_grad.data());
      continue;
    }
    const std::vector<double> psi = Psi(batch, scale);
    for (int k = 0; k < kSize; ++k) {
      const double bias_grad = GateVjp(psi[k], psi_grad[scale][k]);
      out.gate_grad[k] += batch.scales[scale] * bias_grad;
      out.gate_grad[kSize + k] += bias_grad;
    }
  }
  AddNorms(batch, out);
  return out;
}

PairBatch RandomPairBatch(int num_pixels, int num_scales, int label_words, uint64_t seed) {
  PairBatch batch;
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal;
  batch.num_pixels = num_pixels;
  batch.num_scales = num_scales;
  batch.num_cells = std::min(num_pixels, 6);
  batch.label_words = label_words;
  for (int i = 0; i < num_pixels * kSize; ++i) {
    batch.features.push_back(static_cast<float>(0.3 * normal(engine) + 0.1));
  }
  for (int i = 0; i < kGateSize; ++i) batch.gate.push_back(static_cast<float>(normal(engine)));
  for (int i = 0; i < num_pixels; ++i) {
    batch.cell.push_back(static_cast<int32_t>(engine() % batch.num_cells));
    batch.weight.push_back(static_cast<float>(1 / (50 + 1000.0 * batch.cell.back())));
    batch.alpha.push_back(static_cast<float>(0.7 + 0.3 * uniform(engine)));
  }
  for (int i = 0; i < num_scales; ++i) {
    batch.scales.push_back(static_cast<float>(1.2 * uniform(engine)));
  }
  for (int i = 0; i < num_scales * batch.num_cells * label_words; ++i) {
    // Few bits, so that both intersecting and disjoint labels are frequent.
    batch.labels.push_back(uint64_t{1} << (engine() % 3) | uint64_t{engine() % 2} << 40);
  }
  for (uint64_t& word : batch.labels) word = engine() % 4 == 0 ? 0 : word;
  return batch;
}

}  // namespace pepeseg
