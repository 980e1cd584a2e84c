#include "server/services/text_command.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/base/child_process.h"
#include "core/base/errors.h"
#include "core/base/file_io.h"
#include "core/base/status_macros.h"
#include "core/formats/images.h"
#include "server/api/error.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostTexts = 256;
constexpr size_t kLogTail = 1000;  // bytes of the program's output in the log
// Time for the worker to start, and to end after the program.
constexpr absl::Duration kWorkerTime = absl::Seconds(5);

absl::Status MakeTextFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  return error ? FileError(folder, "make", error.value()) : absl::OkStatus();
}

// Returns the bytes of all files below a folder. The program may be writing meanwhile.
int64_t BytesBelow(const fs::path& folder) {
  int64_t bytes = 0;
  std::error_code error;
  for (auto at = fs::recursive_directory_iterator(folder, error);
       !error && at != fs::recursive_directory_iterator(); at.increment(error)) {
    std::error_code gone;
    if (!at->is_regular_file(gone) || at->is_symlink(gone)) continue;
    const auto size = at->file_size(gone);
    if (!gone) bytes += static_cast<int64_t>(size);
  }
  return bytes;
}

}  // namespace

// One run of the program, in a folder that goes with it.
class TextCommand::Run {
 public:
  Run(const Dependencies& deps, const WordQuery& query) : deps_(deps), query_(query) {}
  ~Run() {
    std::error_code ignored;
    if (!folder_.empty()) fs::remove_all(folder_, ignored);
  }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  absl::Status Start() {
    RETURN_IF_ERROR(MakeTextFolder(deps_.scratch));
    std::string path = deps_.scratch / "text-XXXXXX";
    if (mkdtemp(path.data()) == nullptr) return FileError(path, "make", errno);
    folder_ = path;
    RETURN_IF_ERROR(MakeTextFolder(TextPhotos(folder_)));
    return MakeTextFolder(TextAnswers(folder_));
  }

  // Adds the photograph of the next view.
  absl::Status Add(const SeenView& seen) {
    const ModelView& view = query_.model->model().views[seen.view];
    ASSIGN_OR_RETURN(const Image image, deps_.photographs.Of(query_.model, view, query_.check));
    ASSIGN_OR_RETURN(const std::string png, EncodePng(image));
    const fs::path file = TextPhotos(folder_) / (TextStem(photographs_.size()) + ".png");
    RETURN_IF_ERROR(WriteFileAtomically(file, png));
    photographs_.push_back({image.width, image.height, seen.width, seen.height});
    return absl::OkStatus();
  }

  absl::Status RunProgram() const {
    TextTask task = deps_.task;
    task.folder = folder_;
    task.text = query_.text;
    ChildCommand command;
    command.program = deps_.worker;
    command.arguments = {"--text=" + FormatTextTask(task)};
    command.log = folder_ / "worker.log";
    command.time_limit = task.time_limit + kWorkerTime;
    const absl::StatusOr<ChildEnd> end =
        RunChild(command, [&](std::span<const std::string>) -> absl::Status {
          if (BytesBelow(TextAnswers(folder_)) > kMaxOutputBytes) {
            return absl::OutOfRangeError(
                absl::StrCat("wrote more than ", kMaxOutputBytes, " bytes"));
          }
          return query_.check();
        });
    if (!end.ok()) return Failed(end.status());
    if (end->signal == 0 && end->exit_code == 0) return absl::OkStatus();
    std::string why(absl::StripAsciiWhitespace(ReadFileTail(command.log, kLogTail)));
    if (why.empty()) why = absl::StrCat("its worker ", Describe(*end));
    return Failed(absl::FailedPreconditionError(why));
  }

  // Returns what the program has found in each photograph.
  absl::StatusOr<std::vector<std::vector<Sighting>>> Read() const {
    std::vector<std::vector<Sighting>> sightings(photographs_.size());
    for (size_t i = 0; i < photographs_.size(); ++i) {
      const std::string name = TextStem(i) + ".json";
      const fs::path file = TextAnswers(folder_) / name;
      std::error_code ignored;
      // A link could lead elsewhere.
      if (!fs::is_regular_file(fs::symlink_status(file, ignored))) continue;
      auto text = ReadFile(file, name, kMaxTextAnswerBytes);
      if (!text.ok()) return Failed(text.status());
      auto things = ParseTextSightings(*text, name, photographs_[i]);
      if (!things.ok()) return Failed(things.status());
      sightings[i] = *std::move(things);
    }
    return sightings;
  }

 private:
  // Returns the error of the request. Its check's errors stay; the log has the program's output.
  absl::Status Failed(const absl::Status& why) const {
    RETURN_IF_ERROR(query_.check());
    const std::string name = fs::path(deps_.task.program).filename();
    spdlog::warn("the text command {}: {}; its output ends with: {}", name, why.ToString(),
                 ReadFileTail(TextLog(folder_), kLogTail));
    return WithResource(
        absl::FailedPreconditionError(absl::StrCat("the text command ", name, ": ", why.message(),
                                                   "; the server's log has the end of its output")),
        "TEXT_COMMAND_FAILED", name);
  }

  const Dependencies& deps_;
  const WordQuery& query_;
  fs::path folder_;  // empty: not made
  std::vector<SearchedPhotograph> photographs_;
};

TextCommand::TextCommand(const Dependencies& deps) : deps_(deps), recent_(kMostTexts) {}

absl::StatusOr<TextCommand::Words> TextCommand::Ask(const WordQuery& query,
                                                    const SceneSegments& scene) const {
  Run run(deps_, query);
  RETURN_IF_ERROR(run.Start());
  for (const SeenView& seen : scene.views) RETURN_IF_ERROR(run.Add(seen));
  RETURN_IF_ERROR(run.RunProgram());
  ASSIGN_OR_RETURN(const auto sightings, run.Read());
  return VoteWords(scene, sightings, 1);
}

absl::StatusOr<WordAnswer> TextCommand::Find(const WordQuery& query) {
  WordAnswer answer;
  // A text that begins with a dash could be read as an option of the program.
  if (deps_.task.program.empty() || query.text.starts_with('-')) return answer;
  ASSIGN_OR_RETURN(const std::shared_ptr<const SceneSegments> scene, query.segments());
  const std::string key =
      absl::StrCat(query.model.id.scene.id, "/", query.model.id.number, "/", query.text);
  const std::lock_guard lock(mutex_);
  const Words* words = recent_.Find(key);
  if (words == nullptr) {
    RETURN_IF_ERROR(query.check());
    ASSIGN_OR_RETURN(Words found, Ask(query, *scene));
    words = recent_.Keep(key, std::move(found));
  }
  for (const SegmentWord& thing : ThingsOfWord(*scene, *words, 0)) {
    answer.things.push_back({thing.score, query.text, thing.segment, ""});
  }
  return answer;
}

}  // namespace pepeseg
