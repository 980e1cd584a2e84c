#include "core/features/feature_optimizer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "core/base/status_macros.h"
#include "kernels/math/gate.h"
#include "kernels/ops/smooth.h"

namespace pepeseg {
namespace {

constexpr float kInitialDeviation = 0.01f;  // of each number of a feature
constexpr int kFirstSequence = 200;  // first key for Backend::Sequence; stage one has smaller ones
constexpr int kNumKinds = 8;         // of a step, see KindOf
constexpr int kMostStepsAtOnce = 2;
// A step of more Gaussians fills a device by itself, and another step takes 132 bytes for each.
constexpr int64_t kMostGaussiansAtOnce = 500'000;
// Keeps these random numbers apart from the drawer's.
constexpr uint64_t kStream = 0x9e3779b97f4a7c15u;

// Returns c(t) of FeatureState times the factor of the learning rate schedule, for t from 0 to
// num_steps. With the schedule in c, a Gaussian that catches up is moved by the learning rates of
// the steps that it missed.
std::vector<float> Corrections(const FeatureRates& rates, const FeatureOptions& options,
                               const LeftOutSteps& left_out) {
  // Adam's bias correction sqrt(1 - beta2^t) / (1 - beta1^t), times (final rate / first
  // rate)^share: the learning rate falls exponentially. Entries of steps already done keep their
  // values when steps are left out.
  std::vector<float> terms(options.num_steps + 1);
  const double fall = double{options.learning_rate_final} / double{options.learning_rate};
  double power1 = 1, power2 = 1;
  for (int t = 1; t <= options.num_steps; ++t) {
    power1 *= double{rates.beta1};
    power2 *= double{rates.beta2};
    const double share = ShareOfFall(t - 1, options.num_steps, left_out);
    terms[t] = static_cast<float>(std::pow(fall, share) * std::sqrt(1 - power2) / (1 - power1));
  }
  return terms;
}

// Returns nearly normal numbers, each the sum of four 16-bit uniform numbers (Irwin-Hall): the same
// with every standard library, unlike std::normal_distribution, and fast.
std::vector<float> NormalNumbers(int64_t count, float deviation, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<float> numbers(count);
  constexpr float kUnit = 1.0f / 65536;
  const float scale = deviation * std::sqrt(3.0f);  // four uniforms have a variance of 1 / 3
  for (float& number : numbers) {
    const uint64_t bits = random();
    const auto sum = static_cast<float>((bits & 0xffff) + (bits >> 16 & 0xffff) +
                                        (bits >> 32 & 0xffff) + (bits >> 48));
    number = scale * (kUnit * sum - 2);
  }
  return numbers;
}

// Returns random numbers for a new gate.
std::vector<float> InitialGate(const FeatureOptions& options) {
  std::vector<float> gate = NormalNumbers(NumGateNumbers(options), 1, (options.seed ^ kStream) + 1);
  if (options.gate_layers == 1) return gate;
  // W2 by He et al. 2015: with sqrt(2 / inputs) the sums over the hidden units have about the
  // spread of the units.
  const float deviation = std::sqrt(2.0f / kGateHidden);
  const std::span<float> outer(gate.data() + 2 * kGateHidden, kGateHidden * kFeatureSize);
  for (float& weight : outer) weight *= deviation;
  return gate;
}

// Returns whether features are smoothed after `num_updates` updates, before the next one.
bool Smooths(const FeatureOptions& options, int num_updates) {
  const int num_smoothed = NumSmoothedSteps(options);
  return num_smoothed > 0 && num_updates <= num_smoothed;
}

// Copies the rows that are not 0.
void CopyNonZero(std::span<const float> from, std::span<float> to) {
  for (int64_t i = 0; i < std::ssize(from) / kFeatureSize; ++i) {
    if (IsZero(from, i)) continue;
    std::ranges::copy(from.subspan(i * kFeatureSize, kFeatureSize), to.begin() + i * kFeatureSize);
  }
}

}  // namespace

int FeatureStepsAtOnce(int num_branches, int64_t num_gaussians, const FeatureOptions& options) {
  if (options.views_at_once > 0) return options.views_at_once;
  if (num_gaussians > kMostGaussiansAtOnce) return 1;
  return std::min(num_branches, kMostStepsAtOnce);
}

bool IsZero(std::span<const float> rows, int64_t gaussian) {
  return std::ranges::all_of(rows.subspan(gaussian * kFeatureSize, kFeatureSize),
                             [](float x) { return x == 0; });
}

std::vector<float> InitialFeatures(int64_t num_gaussians, const FeatureOptions& options) {
  return NormalNumbers(num_gaussians * kFeatureSize, kInitialDeviation, options.seed ^ kStream);
}

FeatureOptimizer::FeatureOptimizer(Backend& backend, const PreparedFeatures& prepared,
                                   std::span<const float> initial, const FeatureOptions& options)
    : backend_(backend),
      num_gaussians_(static_cast<int64_t>(initial.size()) / kFeatureSize),
      graph_(prepared.graph()),
      options_(options),
      centroids_(backend, prepared.capture, *prepared.scene, prepared.views, options),
      smooths_(Smooths(options, 0)),
      features_(backend, initial),
      moment1_(backend, features_.size()),
      moment2_(backend, features_.size()),
      last_step_(backend, num_gaussians_),
      gate_(backend, NumGateNumbers(options)),
      gate_moment1_(backend, NumGateNumbers(options)),
      gate_moment2_(backend, NumGateNumbers(options)),
      sums_(backend, int64_t{kMaxUnreadFeatureSteps} * kNumPairLossSums) {
  rates_.learning_rate = options.learning_rate;
  correction_ = Buffer<float>(backend, std::span<const float>(Corrections(rates_, options, {})));
  rates_.correction = correction_.span();
  buffers_.resize(FeatureStepsAtOnce(backend.num_branches(), num_gaussians_, options));
  for (StepBuffers& of_step : buffers_) {
    of_step.smoothed = Buffer<float>(backend, features_.size());
    of_step.inv_length = Buffer<float>(backend, num_gaussians_);
    of_step.gate_grad = Buffer<float>(backend, NumGateNumbers(options));
  }
  gate_.Upload(InitialGate(options));
}

void FeatureOptimizer::LeaveOut(const LeftOutSteps& steps) {
  correction_.Upload(Corrections(rates_, options_, steps));
}

void FeatureOptimizer::Train(std::span<const RowChunk::Step> steps) {
  // The kinds of the steps are the digits of the key, after a first digit of 1.
  int key = 1;
  for (const RowChunk::Step& step : steps) key = kNumKinds * key + KindOf(step);
  backend_.Sequence(kFirstSequence + key, [&] { QueueOps(steps); });
}

// A bit for each part of a step that not all steps have. A backend may reuse the graph of the last
// steps of the same kinds.
int FeatureOptimizer::KindOf(const RowChunk::Step& step) const {
  int kind = step.neighbors.gaussian.empty() ? 0 : 1;
  for (const LossTerm* term : terms_) kind = 2 * kind + (term->IsIn(step) ? 1 : 0);
  return kind;
}

// PairLoss writes the gradients of the labelled pixels, and the terms add to those of all.
void FeatureOptimizer::ReserveBatch(const RowChunk::Step& step, StepBuffers& of_step) {
  const auto num_pixels = static_cast<int64_t>(step.batch->pixels.size());
  of_step.pixel_features.Reserve(backend_, num_pixels * kFeatureSize);
  of_step.pixel_grad.Reserve(backend_, num_pixels * kFeatureSize);
  of_step.sum_grad.Reserve(backend_, step.columns.gaussian.size * kFeatureSize);
  const int64_t num_labelled = int64_t{step.batch->num_labelled} * kFeatureSize;
  const DeviceSpan<float> unlabelled =
      of_step.pixel_grad.span().Subspan(num_labelled, of_step.pixel_grad.size() - num_labelled);
  if (!unlabelled.empty()) backend_.Zero(unlabelled.data, unlabelled.size * sizeof(float));
}

// The order of the ops matters: catch up what all batches read, find the gradients of all, then
// update by one after the other. The ops of a branch run in the order in which they are queued.
void FeatureOptimizer::QueueOps(std::span<const RowChunk::Step> steps) {
  std::vector<std::function<void()>> gradients;
  for (size_t k = 0; k < steps.size(); ++k) {
    ReserveBatch(steps[k], buffers_[k]);
    if (!steps[k].neighbors.gaussian.empty()) {
      backend_.FeatureCatchUp({steps[k].neighbors.gaussian, rates_, step_, State()});
    }
    const int unread_step = num_unread_++;
    gradients.emplace_back(
        [this, k, unread_step, steps] { QueueGradients(steps[k], buffers_[k], unread_step); });
  }
  backend_.Branches(gradients);
  for (size_t k = 0; k < steps.size(); ++k) {
    // The update of the step before has passed over what that step did not reach.
    if (k > 0 && !steps[k].neighbors.gaussian.empty()) {
      backend_.FeatureCatchUp({steps[k].neighbors.gaussian, rates_, step_, State()});
    }
    QueueUpdate(steps[k], buffers_[k]);
  }
}

// Smooths what the batch reads, blends the features of its pixels, lets PairLoss overwrite the
// gradients of the labelled pixels and the gate, adds the other losses to them, then goes back
// through smoothing.
void FeatureOptimizer::QueueGradients(const RowChunk::Step& step, StepBuffers& of_step,
                                      int unread_step) {
  const PixelBatch& batch = *step.batch;
  const int64_t num_labelled = int64_t{batch.num_labelled} * kFeatureSize;
  if (!step.neighbors.gaussian.empty()) {
    backend_.SmoothFeatures({.graph = graph_,
                             .drawn = batch.drawn_neighbors,
                             .gaussian = step.columns.gaussian,
                             .features = features_.span(),
                             .smoothed = of_step.smoothed.span(),
                             .inv_length = of_step.inv_length.span()});
  }
  backend_.FeatureRows({step.rows, of_step.smoothed.span(), of_step.pixel_features.span()});
  backend_.PairLoss(
      {.pixel_features = of_step.pixel_features.span().Subspan(0, num_labelled),
       .pixel_weight = step.weight,
       .pixel_alpha = step.alpha.Subspan(0, batch.num_labelled),
       .pixel_cell = step.cell,
       .labels = step.labels,
       .num_cells = batch.num_cells,
       .label_words = batch.label_words,
       .scales = step.scales,
       .gate = gate_.span(),
       .min_positive = options_.min_positive_cosine,
       .max_negative = options_.max_negative_cosine,
       .negative_margin = options_.negative_margin,
       .min_norm_alpha = options_.min_norm_alpha,
       .joint_mean = options_.joint_pair_mean,
       .pair_seed = batch.pair_seed,
       .pixel_grad = of_step.pixel_grad.span().Subspan(0, num_labelled),
       .gate_grad = of_step.gate_grad.span(),
       .sums = sums_.span().Subspan(int64_t{unread_step} * kNumPairLossSums, kNumPairLossSums)});
  const LossTerm::Spans spans = {of_step.pixel_features.span(), gate_.span(),
                                 of_step.pixel_grad.span(), of_step.gate_grad.span()};
  for (LossTerm* term : terms_) {
    if (term->IsIn(step)) term->AddGradients(step, spans, unread_step);
  }
  backend_.SmoothBackward({.columns = step.columns,
                           .pixel_grad = of_step.pixel_grad.span(),
                           .smoothed = of_step.smoothed.span(),
                           .inv_length = of_step.inv_length.span(),
                           .sum_grad = of_step.sum_grad.span()});
}

void FeatureOptimizer::QueueUpdate(const RowChunk::Step& step, StepBuffers& of_step) {
  backend_.FeatureUpdate({.columns = step.neighbors,
                          .pixel_grad = of_step.sum_grad.span(),
                          .of_direction = true,
                          .gate_grad = of_step.gate_grad.span(),
                          .rates = rates_,
                          .step = ++step_,
                          .state = State(),
                          .gate = gate_.span(),
                          .gate_moment1 = gate_moment1_.span(),
                          .gate_moment2 = gate_moment2_.span()});
}

std::vector<double> FeatureOptimizer::ReadLosses() {
  std::vector<double> sums(static_cast<size_t>(num_unread_) * kNumPairLossSums);
  sums_.Download(std::span<double>(sums));
  std::vector<double> losses;
  for (int i = 0; i < num_unread_; ++i) {
    const double* of_step = sums.data() + i * kNumPairLossSums;
    // L_m of METHOD.md section 3 and the norms: each a mean over its own pairs or pixels.
    const auto mean = [&](PairLossSum sum, PairLossSum count) {
      return of_step[count] == 0 ? 0.0 : of_step[sum] / of_step[count];
    };
    const double num_pairs = of_step[kNumPositives] + of_step[kNumNegatives];
    const double joint =
        num_pairs == 0 ? 0.0 : (of_step[kPositiveLoss] + of_step[kNegativeLoss]) / num_pairs;
    const double pairs = options_.joint_pair_mean ? joint
                                                  : mean(kPositiveLoss, kNumPositives) +
                                                        mean(kNegativeLoss, kNumNegatives);
    losses.push_back(pairs + mean(kNormLoss, kNumNormPixels));
  }
  std::vector<double> of_terms(losses.size());
  for (LossTerm* term : terms_) {
    const std::vector<double> of_term = term->ReadLosses(num_unread_);
    for (size_t i = 0; i < losses.size(); ++i) of_terms[i] += of_term[i];
  }
  for (size_t i = 0; i < losses.size(); ++i) losses[i] += of_terms[i];
  num_unread_ = 0;
  return losses;
}

absl::Status FeatureOptimizer::RefreshCentroids(int step) {
  if (!centroids_.Due(step)) return absl::OkStatus();
  backend_.FeatureCatchUp({{}, rates_, step_, State()});
  const Buffer<float>& smoothed =
      SmoothAll(features_.span(), smooths_ ? AllNeighbors(graph_) : kItselfOnly);
  std::vector<float> gate(static_cast<size_t>(gate_.size()));
  gate_.Download(std::span<float>(gate));
  return centroids_.Refresh(smoothed.span(), gate);
}

FeatureRowsState FeatureOptimizer::Save() const {
  const auto download = [](const auto& buffer, auto& values) {
    values.resize(static_cast<size_t>(buffer.size()));
    buffer.Download(std::span(values));
  };
  FeatureRowsState rows;
  download(features_, rows.features);
  download(moment1_, rows.moment1);
  download(moment2_, rows.moment2);
  download(last_step_, rows.last_step);
  download(gate_, rows.gate);
  download(gate_moment1_, rows.gate_moment1);
  download(gate_moment2_, rows.gate_moment2);
  return rows;
}

absl::Status FeatureOptimizer::Restore(const FeatureRowsState& rows, const CentroidState& centroids,
                                       int step) {
  // The corrections are not saved: they follow from the options and LeaveOut.
  step_ = step;
  smooths_ = Smooths(options_, step);
  Upload(rows);
  return centroids_.Restore(centroids);
}

void FeatureOptimizer::Upload(const FeatureRowsState& rows) {
  features_.Upload(rows.features);
  moment1_.Upload(rows.moment1);
  moment2_.Upload(rows.moment2);
  last_step_.Upload(rows.last_step);
  gate_.Upload(rows.gate);
  gate_moment1_.Upload(rows.gate_moment1);
  gate_moment2_.Upload(rows.gate_moment2);
}

const Buffer<float>& FeatureOptimizer::SmoothAll(DeviceSpan<const float> features, uint32_t drawn) {
  StepBuffers& of_step = buffers_.front();
  backend_.SmoothFeatures({.graph = graph_,
                           .drawn = drawn,
                           .gaussian = {},
                           .features = features,
                           .smoothed = of_step.smoothed.span(),
                           .inv_length = of_step.inv_length.span()});
  return of_step.smoothed;
}

std::vector<float> FeatureOptimizer::TouchedFeatures() {
  backend_.FeatureCatchUp({{}, rates_, step_, State()});
  std::vector<float> features(static_cast<size_t>(features_.size())), moment2(features.size());
  features_.Download(std::span<float>(features));
  moment2_.Download(std::span<float>(moment2));
  // The second moment is over 0 if a gradient ever reached the Gaussian. Others still have their
  // random initial feature.
  for (int64_t i = 0; i < num_gaussians_; ++i) {
    if (IsZero(moment2, i)) std::fill_n(features.begin() + i * kFeatureSize, kFeatureSize, 0.0f);
  }
  return features;
}

void FeatureOptimizer::EndSmoothing() {
  if (!smooths_) return;
  smooths_ = false;
  const Buffer<float> touched(backend_, std::span<const float>(TouchedFeatures()));
  std::vector<float> features(static_cast<size_t>(features_.size())), smoothed(features.size());
  features_.Download(std::span<float>(features));
  SmoothAll(touched.span(), AllNeighbors(graph_)).Download(std::span<float>(smoothed));
  CopyNonZero(smoothed, features);
  features_.Upload(std::span<const float>(features));
}

void FeatureOptimizer::Export(FeatureField& field) {
  std::vector<float> own = TouchedFeatures();
  const Buffer<float> on_device(backend_, std::span<const float>(own));
  field.features.resize(own.size());
  SmoothAll(on_device.span(), AllNeighbors(graph_)).Download(std::span<float>(field.features));
  if (!smooths_) {
    // Normalises.
    SmoothAll(on_device.span(), kItselfOnly).Download(std::span<float>(own));
    CopyNonZero(own, field.features);
  }
  field.gate.resize(static_cast<size_t>(gate_.size()));
  gate_.Download(std::span<float>(field.gate));
}

// The copy is on the host, because the estimate of the device's memory has no room for a second
// one.
void FeatureOptimizer::ExportUnchanged(FeatureField& field) {
  const FeatureRowsState rows = Save();
  Export(field);
  Upload(rows);
}

}  // namespace pepeseg
