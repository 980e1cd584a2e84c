#include "clients/terminal/progress_line.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "clients/terminal/text_table.h"

namespace pepeseg::client::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kBarCells = 12;
// Shortest time between two lines.
constexpr auto kTerminalPace = std::chrono::milliseconds(100);
constexpr auto kPlainPace = std::chrono::seconds(10);

// Returns to the start of the terminal's line and erases it.
constexpr char kEraseLine[] = "\r\x1b[K";

// Returns "[######......]".
std::string Bar(double share) {
  const int filled = static_cast<int>(std::clamp(share, 0.0, 1.0) * kBarCells);
  return absl::StrCat("[", std::string(filled, '#'), std::string(kBarCells - filled, '.'), "]");
}

// Returns "1,234,567" for 1234567.
std::string Grouped(int64_t number) {
  std::string digits = std::to_string(number);
  for (int at = static_cast<int>(digits.size()) - 3; at > 0; at -= 3) digits.insert(at, ",");
  return digits;
}

double Share(int64_t done, int64_t all) {
  return all <= 0 ? 0.0 : static_cast<double>(done) / static_cast<double>(all);
}

std::string StageOf(const v1::JobProgress& progress) {
  if (progress.num_stages() == 0) return "";
  return absl::StrCat("stage ", progress.stage_number(), " of ", progress.num_stages());
}

// Returns the time left of the job, or of its stage if only that is known, and the stage's number.
std::string TimeLeft(const v1::JobProgress& progress) {
  const std::string stage = StageOf(progress);
  if (progress.has_job_eta()) {
    return absl::StrCat("about ", AboutText(SecondsOf(progress.job_eta())), " left",
                        stage.empty() ? "" : ", ", stage);
  }
  if (!progress.has_eta()) return stage;
  return absl::StrCat("about ", AboutText(SecondsOf(progress.eta())), " left of ",
                      stage.empty() ? "this stage" : stage);
}

// Returns "5 min left 3/5".
std::string ShortTimeLeft(const v1::JobProgress& progress) {
  std::string text;
  if (progress.has_job_eta()) text = AboutText(SecondsOf(progress.job_eta())) + " left";
  if (progress.num_stages() == 0) return text;
  return absl::StrCat(text, text.empty() ? "" : " ", progress.stage_number(), "/",
                      progress.num_stages());
}

// Returns the other parts of a progress line, the most important first.
std::vector<std::string> PartsOf(const v1::JobProgress& progress) {
  const std::string stage = WordOf(progress.stage());
  std::vector<std::string> parts;
  if (progress.activity().empty()) {
    parts.push_back(absl::StrCat(stage, " ", progress.step(), "/", progress.num_steps()));
  } else {
    parts.push_back(absl::StrCat(stage, ": ", progress.activity(), " ", progress.step(), " of ",
                                 progress.num_steps(), " ", progress.unit()));
  }
  parts.push_back(Bar(Share(progress.step(), progress.num_steps())));
  if (progress.has_loss()) parts.push_back(absl::StrFormat("loss %.4f", progress.loss()));
  if (progress.has_psnr()) parts.push_back(absl::StrFormat("%.2f dB", progress.psnr()));
  if (progress.num_gaussians() > 0) {
    parts.push_back(absl::StrCat(Grouped(progress.num_gaussians()), " Gaussians"));
  }
  return parts;
}

}  // namespace

double SecondsOf(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + static_cast<double>(duration.nanos()) * 1e-9;
}

std::string ClockText(double seconds) {
  const int64_t whole = std::max<int64_t>(0, std::llround(seconds));
  const int64_t hours = whole / 3600;
  if (hours == 0) return absl::StrFormat("%d:%02d", whole / 60, whole % 60);
  return absl::StrFormat("%d:%02d:%02d", hours, whole / 60 % 60, whole % 60);
}

std::string AboutText(double seconds) {
  constexpr int64_t kExact = 10;  // seconds; longer times are rounded to 5 seconds
  int64_t whole = std::max<int64_t>(0, std::llround(seconds));
  if (whole > kExact) whole = (whole + 2) / 5 * 5;
  if (whole < 60) return absl::StrCat(whole, " s");
  const int64_t minutes = (whole + 30) / 60;
  if (minutes < 60) return absl::StrCat(minutes, " min");
  if (minutes % 60 == 0) return absl::StrCat(minutes / 60, " h");
  return absl::StrCat(minutes / 60, " h ", minutes % 60, " min");
}

std::string ProgressText(const v1::JobProgress& progress, size_t columns) {
  std::string text = TimeLeft(progress);
  if (text.size() > columns) text = ShortTimeLeft(progress);
  for (const std::string& part : PartsOf(progress)) {
    const std::string longer = text.empty() ? part : absl::StrCat(text, "  ", part);
    if (longer.size() > columns) break;
    text = longer;
  }
  return text;
}

std::string UploadText(int64_t bytes, int64_t num_bytes, size_t columns) {
  const std::string text =
      absl::StrFormat("%-11s %s  %.1f/%.1f MB", "upload", Bar(Share(bytes, num_bytes)),
                      static_cast<double>(bytes) * 1e-6, static_cast<double>(num_bytes) * 1e-6);
  return text.substr(0, columns);
}

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) == 1) {
  winsize size{};
  if (terminal_ && ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1) {
    columns_ = size.ws_col - 1U;
  }
}

ProgressLine::~ProgressLine() {
  if (open_) std::fputs("\n", stderr);
}

void ProgressLine::Show(const std::string& text, bool is_last) {
  const auto now = Clock::now();
  if (!is_last && now < next_) return;
  next_ = now + (terminal_ ? Clock::duration(kTerminalPace) : Clock::duration(kPlainPace));
  if (!terminal_) {
    std::fputs((text + "\n").c_str(), stderr);
    return;
  }
  std::fputs((kEraseLine + text + (is_last ? "\n" : "")).c_str(), stderr);
  open_ = !is_last;
}

void ProgressLine::Say(const std::string& text) {
  std::fputs(((open_ ? kEraseLine : "") + text + "\n").c_str(), stderr);
  open_ = false;
}

}  // namespace pepeseg::client::cli
