#include "server/worker/job_eta.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace pepeseg {
namespace {

// A stage has a pace once this share of it was done in at least this many seconds.
constexpr double kFirstShare = 0.01, kFirstSeconds = 1;
// Maximum ratio of measured to expected seconds, and of expected to measured.
constexpr double kMostOff = 100;
// Smoothing: the time constant is this share of the remaining time, clamped to these seconds.
// Within it the predicted end covers 1 - 1/e of its distance to the new estimate.
constexpr double kSmoothShare = 0.1, kLeastSmooth = 2, kMostSmooth = 60;

double PlannedWork(const PlannedStage& stage) {
  double work = 0;
  for (const PlannedStage::Piece& piece : stage.pieces) {
    work += static_cast<double>(piece.num_steps) * piece.seconds_per_step;
  }
  return work;
}

int64_t PlannedSteps(const PlannedStage& stage) {
  int64_t num_steps = 0;
  for (const PlannedStage::Piece& piece : stage.pieces) num_steps += piece.num_steps;
  return num_steps;
}

// Returns the expected seconds of the first `steps` steps.
double WorkUntil(const PlannedStage& stage, int64_t steps) {
  double work = 0;
  for (const PlannedStage::Piece& piece : stage.pieces) {
    const int64_t within = std::clamp<int64_t>(steps, 0, piece.num_steps);
    work += static_cast<double>(within) * piece.seconds_per_step;
    steps -= within;
  }
  return work;
}

}  // namespace

void JobEta::Plan(std::vector<PlannedStage> stages) {
  stages_ = std::move(stages);
  const auto running = std::find_if(stages_.begin(), stages_.end(),
                                    [this](const PlannedStage& s) { return s.stage == running_; });
  current_ = running == stages_.end() ? -1 : static_cast<int>(running - stages_.begin());
}

void JobEta::StartStage(Stage stage, double now) {
  EndStage(now);
  running_ = stage;
  stage_start_ = now;
  Plan(std::move(stages_));
}

void JobEta::EndStage(double now) {
  // A stage of less than a second says nothing about the pace of one of minutes.
  if (current_ >= 0 && measured_ && stages_[current_].seconds) {
    const double seconds = now - stage_start_;
    const double expected = *stages_[current_].seconds * (done_ + left_);
    // Host and device are measured separately: a slow disk says nothing about the GPU.
    if (seconds >= kFirstSeconds && expected >= kFirstSeconds) {
      Pace& pace = ended_[stages_[current_].on_device ? 1 : 0];
      pace.seconds += seconds;
      pace.expected += expected;
    }
  }
  measured_ = reported_ = has_share_ = false;
  done_ = 0;
  left_ = 1;
  elapsed_ = 0;
  origin_ = {};
}

void JobEta::Step(int64_t first_step, int64_t step, int64_t num_steps, double now) {
  if (num_steps <= 0) return;
  const auto all = static_cast<double>(num_steps);
  double done = static_cast<double>(step - first_step) / all;
  double left = static_cast<double>(num_steps - step) / all;
  if (current_ >= 0 && PlannedWork(stages_[current_]) > 0) {
    const PlannedStage& stage = stages_[current_];
    const double work = PlannedWork(stage);
    done = (WorkUntil(stage, step) - WorkUntil(stage, first_step)) / work;
    left = 1 - WorkUntil(stage, PlannedSteps(stage) - (num_steps - step)) / work;
  }
  Measure(done, left, now);
}

void JobEta::Share(double share, double now) { Measure(share, 1 - share, now); }

// Records shares of the running stage's expected work. They add up to less than 1 when an earlier
// attempt did a part, or when the stage has left out steps. The pace counts from the first report
// if that comes early in the stage: the time before it was taken by what precedes the steps.
void JobEta::Measure(double done, double left, double now) {
  done_ = std::max(0.0, done);
  left_ = std::clamp(left, 0.0, 1.0);
  elapsed_ = now - stage_start_;
  // Shares of what this attempt has to do.
  const double first_share = kFirstShare * (done_ + left_);
  if (!reported_ && done_ < first_share) origin_ = {elapsed_, done_};
  reported_ = true;
  has_share_ = done_ > origin_.expected && (left_ == 0 || done_ - origin_.expected >= first_share);
  measured_ = has_share_ && (left_ == 0 || elapsed_ - origin_.seconds >= kFirstSeconds);
}

std::optional<double> JobEta::StageSecondsLeft() const {
  if (!has_share_) return std::nullopt;
  return (elapsed_ - origin_.seconds) / (done_ - origin_.expected) * left_;
}

// Returns the ratio of measured to expected seconds on one kind of processor, over the stages that
// have ended and the running one; 1 if none has a pace.
double JobEta::SpeedOf(bool on_device) const {
  Pace pace = ended_[on_device ? 1 : 0];
  if (current_ >= 0 && measured_ && stages_[current_].on_device == on_device &&
      stages_[current_].seconds) {
    pace.seconds += elapsed_;
    pace.expected += *stages_[current_].seconds * done_;
  }
  if (pace.expected <= 0) return 1;
  return std::clamp(pace.seconds / pace.expected, 1 / kMostOff, kMostOff);
}

// Returns the remaining seconds of the job without smoothing.
std::optional<double> JobEta::RawSecondsLeft() const {
  const bool any = ended_[0].expected > 0 || ended_[1].expected > 0 || measured_;
  if (current_ < 0 || !any) return std::nullopt;
  const PlannedStage& running = stages_[current_];
  double seconds = 0;
  if (measured_) {
    seconds = *StageSecondsLeft();
  } else if (running.seconds) {
    seconds = *running.seconds * left_ * SpeedOf(running.on_device);
  } else {
    return std::nullopt;
  }
  for (size_t i = current_ + 1; i < stages_.size(); ++i) {
    // One unknown stage makes the end of the job unknown.
    if (!stages_[i].seconds) return std::nullopt;
    seconds += *stages_[i].seconds * SpeedOf(stages_[i].on_device);
  }
  return seconds;
}

std::optional<double> JobEta::SecondsLeft(double now) {
  const std::optional<double> raw = RawSecondsLeft();
  if (!raw) {
    end_.reset();
    return std::nullopt;
  }
  const double target = now + *raw;
  if (!end_) {
    end_ = target;
  } else {
    const double left = std::min(*end_ - now, *raw);
    const double time = std::clamp(kSmoothShare * left, kLeastSmooth, kMostSmooth);
    *end_ += (1 - std::exp(-(now - last_) / time)) * (target - *end_);
  }
  last_ = now;
  return std::max(0.0, *end_ - now);
}

}  // namespace pepeseg
