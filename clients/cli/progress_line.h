#pragma once

#include <chrono>
#include <string>

#include "pepeseg/v1/job_service.pb.h"

namespace pepeseg::client::cli {

// "about 5 min left, stage 3 of 5  reconstruct 1200/2400  [#####.....]  loss 0.0612  21.3 dB
// 84,120 Gaussians". What is left of the job comes first and is never cut off, in few columns it
// is "5 min left 3/5"; of the rest, as many parts as fit into `columns`.
std::string ProgressText(const v1::JobProgress& progress, size_t columns);
// "upload [####......]  12.3/42.0 MB".
std::string UploadText(int64_t bytes, int64_t num_bytes, size_t columns);
// "1:05" or "2:01:05".
std::string ClockText(double seconds);
// "40 s", "5 min", "1 h 20 min": rounded as people say it.
std::string AboutText(double seconds);

// Long work on standard error: one line that is rewritten where that is a terminal, else a plain
// line every ten seconds and at the end.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void Show(const std::string& text, bool is_last = false);
  // A line of its own, above the progress.
  void Say(const std::string& text);
  size_t columns() const { return columns_; }

 private:
  bool terminal_ = false;
  bool open_ = false;  // the terminal's line holds a progress text
  size_t columns_ = 100;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace pepeseg::client::cli
