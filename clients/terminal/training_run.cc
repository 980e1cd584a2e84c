#include "clients/terminal/training_run.h"

#include <filesystem>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/time/clock.h"
#include "clients/cpp/file_bytes.h"
#include "clients/cpp/option_setting.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/failure.h"
#include "clients/terminal/progress_line.h"
#include "clients/terminal/text_table.h"

namespace pepeseg::client::cli {
namespace {

// Returns "reconstruct done in 12.3 s  METRIC VALUE", or "sfm         skipped: given".
std::string StageEndedText(const v1::JobEvent::StageEnded& ended) {
  const std::string stage = WordOf(ended.stage());
  std::string text =
      ended.skipped().empty()
          ? absl::StrFormat("%-11s done in %.1f s", stage, SecondsOf(ended.elapsed()))
          : absl::StrFormat("%-11s skipped: %s", stage, ended.skipped());
  for (const auto& [name, value] : ended.metrics()) {
    absl::StrAppendFormat(&text, "  %s %.4g", name, value);
  }
  return text;
}

// Returns "reconstruct depth skipped: REASON, from step 1200 on; saves 300 steps, about 4.5 s".
std::string TermSkippedText(const v1::JobEvent::TermSkipped& skipped) {
  std::string text = absl::StrFormat("%-11s %s skipped: %s", WordOf(skipped.stage()),
                                     WordOf(skipped.term()), skipped.reason());
  if (skipped.step() > 0) absl::StrAppendFormat(&text, ", from step %d on", skipped.step());
  if (skipped.saved_steps() > 0) {
    absl::StrAppendFormat(&text, "; saves %d steps, about %.1f s", skipped.saved_steps(),
                          SecondsOf(skipped.saved()));
  }
  return text;
}

// Shows an event on standard error.
void ShowEvent(const v1::JobEvent& event, ProgressLine& line) {
  switch (event.event_case()) {
    case v1::JobEvent::kSnapshot:
      if (event.snapshot().state() == v1::JOB_STATE_QUEUED) {
        const std::string wait = WaitText(event.snapshot().wait(), absl::Now());
        line.Say(wait.empty() ? "queued" : absl::StrCat("queued: ", wait));
      }
      if (event.snapshot().has_progress()) {
        line.Show(ProgressText(event.snapshot().progress(), line.columns()));
      }
      break;
    case v1::JobEvent::kProgress: {
      const v1::JobProgress& progress = event.progress();
      line.Show(ProgressText(progress, line.columns()), progress.step() >= progress.num_steps());
      break;
    }
    case v1::JobEvent::kStageEnded:
      line.Say(StageEndedText(event.stage_ended()));
      break;
    case v1::JobEvent::kTermSkipped:
      line.Say(TermSkippedText(event.term_skipped()));
      break;
    case v1::JobEvent::kWarning:
      line.Say("warning: " + event.warning().message());
      break;
    default:
      break;
  }
}

// Writes FOLDER/reconstruct-000120.jpg, so that names sort by the step.
absl::Status WritePreview(const std::string& folder, const v1::JobEvent::Preview& preview) {
  const std::filesystem::path path =
      std::filesystem::path(folder) /
      absl::StrFormat("%s-%06d.jpg", WordOf(preview.stage()), preview.step());
  RETURN_IF_ERROR(MakeParentFolder(path));
  return WriteFile(path, preview.jpeg());
}

// Returns an error unless the job succeeded.
absl::Status Outcome(const v1::Job& job) {
  const std::string word = WordOf(job.stage());
  const std::string stage = word.empty() ? "" : absl::StrCat(" in stage ", word);
  if (job.state() == v1::JOB_STATE_FAILED) {
    return JobFailed(absl::StrCat(job.name(), " failed", stage, ": ", job.error().message()));
  }
  if (job.state() == v1::JOB_STATE_CANCELLED) {
    return JobCancelled(absl::StrCat(job.name(), " was cancelled", stage));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<v1::Dataset> UploadFolder(const Client& client, const std::string& scene,
                                         const DatasetFolder& folder) {
  ProgressLine line;
  UploadProgress progress;
  progress.bytes = [&line](int64_t num_there, int64_t num_bytes) {
    line.Show(UploadText(num_there, num_bytes, line.columns()), num_there == num_bytes);
  };
  progress.note = [&line](const std::string& what) { line.Say(what); };
  return client.Upload(scene, folder, progress);
}

void AddDepthKindFlag(CLI::App& verb, std::string& depth_kind) {
  verb.add_option("--depth-kind", depth_kind,
                  "Kind of the files in depth/: \"depth\" (far is large, 0 unknown) or "
                  "\"disparity\" (near is large), which files in disparity/ always are")
      ->check(CLI::IsMember({"depth", "disparity"}))
      ->capture_default_str();
}

v1::FileKind DepthKind(const std::string& depth_kind) {
  return depth_kind == "depth" ? v1::FILE_KIND_DEPTH : v1::FILE_KIND_DISPARITY;
}

absl::StatusOr<v1::Job> StartTraining(const Client& client, const std::string& scene,
                                      const std::string& dataset,
                                      const std::vector<std::string>& settings) {
  v1::TrainSceneRequest request;
  request.set_scene(scene);
  request.set_dataset(dataset);
  for (const std::string& setting : settings) {
    RETURN_IF_ERROR(SetOption(setting, *request.mutable_options()));
  }
  return client.Train(std::move(request));
}

absl::StatusOr<v1::Job> WatchJob(const Client& client, const std::string& job, EventFn on_event,
                                 const std::string& previews) {
  ProgressLine line;
  absl::Status written;  // the first error; the job is followed to its end all the same
  const auto show = [&](const v1::JobEvent& event) {
    ShowEvent(event, line);
    if (event.has_preview() && !previews.empty()) {
      written.Update(WritePreview(previews, event.preview()));
    }
    on_event(event);
  };
  const auto say_lost = [&] { line.Say("the connection to the server was lost; trying again"); };
  std::optional<int64_t> after;
  if (!previews.empty()) after = 0;
  ASSIGN_OR_RETURN(const v1::Job ended, client.WatchJob(job, show, say_lost, after));
  RETURN_IF_ERROR(Outcome(ended));
  RETURN_IF_ERROR(written);
  return ended;
}

void AddPreviewsFlag(CLI::App& verb, std::string& previews) {
  verb.add_option(
          "--previews", previews,
          "Folder for pictures of the scene while it is trained: FOLDER/reconstruct-STEP.jpg")
      ->type_name("FOLDER");
}

}  // namespace pepeseg::client::cli
