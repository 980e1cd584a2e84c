#pragma once

#include <google/protobuf/duration.pb.h>

#include <chrono>
#include <cstdint>
#include <string>

#include "pepeseg/v1/job_service.pb.h"

// Progress of long work, as a line on standard error, and durations as text.
namespace pepeseg::client::cli {

// Measures the wall time since its construction.
class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

double SecondsOf(const google::protobuf::Duration& duration);
// Returns "1:05" or "2:01:05".
std::string ClockText(double seconds);
// Returns "40 s", "5 min" or "1 h 20 min", rounded.
std::string AboutText(double seconds);

// Returns "about 5 min left, stage 3 of 5  reconstruct 1200/2400  [#####.....]  loss 0.0612
// 21.3 dB  84,120 Gaussians". The time left of the job comes first and is never cut off; if it does
// not fit into `columns` it is shortened to "5 min left 3/5". The other parts follow as far as they
// fit.
std::string ProgressText(const v1::JobProgress& progress, size_t columns);
// Returns "upload  [####......]  12.3/42.0 MB".
std::string UploadText(int64_t bytes, int64_t num_bytes, size_t columns);

// A progress line on standard error. On a terminal it is rewritten in place; otherwise a plain line
// is printed every ten seconds and at the end.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  // Shows `text`. Calls that come too soon after the one before are dropped unless `is_last`, which
  // ends the line.
  void Show(const std::string& text, bool is_last = false);
  // Prints a line of its own; the next Show begins a new progress line below it.
  void Say(const std::string& text);
  size_t columns() const { return columns_; }  // width of the terminal, or 100

 private:
  bool terminal_ = false;
  bool open_ = false;  // the terminal's last line is a progress line that has not ended
  size_t columns_ = 100;
  std::chrono::steady_clock::time_point next_;  // earliest time of the next Show
};

}  // namespace pepeseg::client::cli
