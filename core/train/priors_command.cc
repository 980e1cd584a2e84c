#include "core/train/priors_command.h"

#include <array>
#include <initializer_list>
#include <optional>
#include <system_error>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "core/base/child_process.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/file_name.h"
#include "core/base/status_macros.h"
#include "core/formats/image_header.h"
#include "core/formats/images.h"
#include "core/formats/plain_copy.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr size_t kOutputTail = 1000;         // bytes of the program's output in an error
constexpr int64_t kMaxOutcomeBytes = 16384;  // largest outcome file that is read
constexpr char kSucceeded[] = "succeeded";

std::string Stem(size_t photo) { return absl::StrFormat("%06d", photo + 1); }

absl::Status MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  return error ? FileError(folder, "create", error.value()) : absl::OkStatus();
}

// Copies the photographs, upright and plain, so that the program needs to know no unusual formats
// and cannot change the stored files.
absl::Status LayOut(std::span<const DatasetFile> photos, const fs::path& folder) {
  RETURN_IF_ERROR(MakeFolder(folder));
  for (size_t i = 0; i < photos.size(); ++i) {
    ASSIGN_OR_RETURN(std::string bytes,
                     ReadFile(photos[i].path, photos[i].name, kMaxImageFileBytes));
    const auto span = [&bytes] {
      return std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
    };
    ASSIGN_OR_RETURN(std::string plain, PlainCopy(span(), photos[i].name));
    if (!plain.empty()) bytes = std::move(plain);
    ASSIGN_OR_RETURN(const ImageHeader header, ReadImageHeader(photos[i].name, span()));
    RETURN_IF_ERROR(WriteFileAtomically(folder / (Stem(i) + SuffixOf(header.format)), bytes));
  }
  return absl::OkStatus();
}

// Parses "progress 3 20". Returns nullopt for a line of another form, or if 3 is not in [1, 20].
std::optional<StepReport> ParseProgress(const std::string& line) {
  const std::vector<absl::string_view> words = absl::StrSplit(line, ' ', absl::SkipWhitespace());
  StepReport report;
  if (words.size() != 3 || words[0] != "progress" || !absl::SimpleAtoi(words[1], &report.step) ||
      !absl::SimpleAtoi(words[2], &report.num_steps)) {
    return std::nullopt;
  }
  if (report.step < 1 || report.step > report.num_steps) return std::nullopt;
  return report;
}

// One run of the program in `folders.priors`, or the outcome of an earlier one. Files in the
// folder:
//   photos/     the copies, while the program runs
//   made/       its results
//   output.log  its standard output and error
//   outcome     "succeeded" or the error, written last
class CommandRun {
 public:
  CommandRun(const TrainingInputs& inputs, std::span<const DatasetFile> photos, PriorWants wants)
      : inputs_(inputs), photos_(photos), wants_(wants), folder_(inputs.folders.priors) {}

  absl::Status Run(StageLog& stages);
  std::vector<DatasetFile> Made() const;

 private:
  absl::Status RunProgram(StageLog& stages);
  std::optional<absl::Status> Kept(StageLog& stages) const;
  absl::Status Watch(std::span<const std::string> lines, StageLog& stages) const;
  std::string Wants() const;
  std::string Name() const { return inputs_.tools.priors_command.program.filename().string(); }
  fs::path out() const { return folder_ / "made"; }
  fs::path log() const { return folder_ / "output.log"; }
  fs::path outcome() const { return folder_ / "outcome"; }

  struct Place {
    FileKind kind;
    const char* folder;
    std::initializer_list<const char*> suffixes;
  };
  std::optional<DatasetFile> Find(const Place& place, size_t photo) const;

  const TrainingInputs& inputs_;
  std::span<const DatasetFile> photos_;
  PriorWants wants_;
  fs::path folder_;
};

std::string CommandRun::Wants() const {
  if (wants_.masks && wants_.depth) return "masks,depth";
  return wants_.masks ? "masks" : "depth";
}

// Returns how the program ended in an earlier run of this training; nullopt: it has not ended yet.
std::optional<absl::Status> CommandRun::Kept(StageLog& stages) const {
  const absl::StatusOr<std::string> text = ReadFile(outcome(), "outcome", kMaxOutcomeBytes);
  if (!text.ok()) return std::nullopt;
  stages.observer().Log("the priors command was run by an earlier attempt");
  if (*text == kSucceeded) return absl::OkStatus();
  return absl::FailedPreconditionError(*text);
}

// Called several times a second with the new lines of the program's output. An error that it
// returns kills the program.
absl::Status CommandRun::Watch(std::span<const std::string> lines, StageLog& stages) const {
  if (stages.observer().IsCancelled())
    return absl::CancelledError("stopped while the priors command ran");
  for (const std::string& line : lines) {
    std::optional<StepReport> report = ParseProgress(line);
    if (!report) continue;
    if (report->num_steps == static_cast<int64_t>(photos_.size())) {
      report->activity = MakingActivity(wants_.masks, wants_.depth);
      report->unit = "photographs";
    }
    RETURN_IF_ERROR(stages.Step(*report));
  }
  return absl::OkStatus();
}

absl::Status CommandRun::RunProgram(StageLog& stages) {
  std::error_code ignored;
  fs::remove(log(), ignored);  // left by a run that was interrupted
  RETURN_IF_ERROR(LayOut(photos_, folder_ / "photos"));
  RETURN_IF_ERROR(MakeFolder(out()));
  ChildCommand command;
  command.program = inputs_.tools.priors_command.program;
  command.arguments = {"--photos", (folder_ / "photos").string(), "--out", out().string(), "--want",
                       Wants()};
  command.log = log();
  command.time_limit = inputs_.tools.priors_command.time_limit;
  stages.observer().Log(
      absl::StrCat(Name(), " makes ", Wants(), " of ", photos_.size(), " photographs"));
  const absl::StatusOr<ChildEnd> end = [&] {
    const Polling polling(stages.observer());
    return RunChild(command,
                    [&](std::span<const std::string> lines) { return Watch(lines, stages); });
  }();
  if (absl::IsCancelled(end.status())) return end.status();
  // Also after a failure. A cancelled run has returned above and keeps them.
  fs::remove_all(folder_ / "photos", ignored);
  std::string why;
  if (!end.ok()) why = std::string(end.status().message());
  if (end.ok() && (end->signal != 0 || end->exit_code != 0)) why = Describe(*end);
  // An exit code of 0 alone proves nothing.
  if (end.ok() && why.empty() && Made().empty()) why = "wrote no " + Wants();
  if (why.empty()) return absl::OkStatus();
  const std::string tail = ReadFileTail(log(), kOutputTail);
  return absl::FailedPreconditionError(
      absl::StrCat("the priors command ", Name(), ": ", why,
                   tail.empty() ? "" : absl::StrCat("; its output ends with: ", tail)));
}

absl::Status CommandRun::Run(StageLog& stages) {
  if (const auto kept = Kept(stages)) return *kept;
  RETURN_IF_ERROR(MakeFolder(folder_));
  absl::Status status = RunProgram(stages);
  // No outcome: the next attempt runs the program again. A failure is kept and not tried again.
  if (absl::IsCancelled(status)) return status;
  RETURN_IF_ERROR(
      WriteFileAtomically(outcome(), status.ok() ? kSucceeded : std::string(status.message())));
  return status;
}

// Returns the photograph's file with the first suffix that exists. Links are not followed: their
// targets are not results of the program.
std::optional<DatasetFile> CommandRun::Find(const Place& place, size_t photo) const {
  for (const char* suffix : place.suffixes) {
    std::error_code ignored;
    const fs::path path = out() / place.folder / (Stem(photo) + suffix);
    if (!fs::is_regular_file(fs::symlink_status(path, ignored))) continue;
    const absl::string_view stem = WithoutSuffix(WithoutFolder(photos_[photo].name, "images"));
    return DatasetFile{place.kind, absl::StrCat(place.folder, "/", stem, suffix), path};
  }
  return std::nullopt;
}

// Returns the files that the program made. A photograph's depth is preferred to its disparity.
std::vector<DatasetFile> CommandRun::Made() const {
  const Place masks{FileKind::kMask, "masks", {".json", ".png"}};
  const Place depth{FileKind::kDepth, "depth", {".png", ".npy", ".pfm"}};
  const Place disparity{FileKind::kDisparity, "disparity", {".png", ".npy", ".pfm"}};
  std::vector<DatasetFile> files;
  for (size_t i = 0; i < photos_.size(); ++i) {
    std::optional<DatasetFile> mask, map;
    if (wants_.masks) mask = Find(masks, i);
    if (wants_.depth) map = Find(depth, i);
    if (wants_.depth && !map) map = Find(disparity, i);
    if (mask) files.push_back(*std::move(mask));
    if (map) files.push_back(*std::move(map));
  }
  return files;
}

}  // namespace

std::string_view MakingActivity(bool masks, bool depth) {
  if (masks && depth) return "making masks and depth for";
  return masks ? "making masks for" : "making depth for";
}

absl::StatusOr<std::vector<DatasetFile>> RunPriorsCommand(const TrainingInputs& inputs,
                                                          std::span<const DatasetFile> photos,
                                                          PriorWants wants, StageLog& stages) {
  CommandRun run(inputs, photos, wants);
  RETURN_IF_ERROR(run.Run(stages));
  return run.Made();
}

std::string SourceOfCommand(const PriorsCommand& command) {
  return absl::StrCat("command ", command.program.filename().string());
}

}  // namespace pepeseg
