#include "server/jobs/photograph_process.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"
#include "server/jobs/launcher.h"
#include "server/worker_protocol/job_isolation.h"

namespace pepeseg {
namespace {

// Interval of looking at the child, which runs for at least 0.1 s.
constexpr absl::Duration kPoll = absl::Milliseconds(5);

absl::Status NotWanted() { return absl::CancelledError("the photograph is no longer wanted"); }

absl::Status Undecodable(const PhotographTask& task, absl::string_view why) {
  return absl::InvalidArgumentError(absl::StrCat(task.name, ": does not decode: ", why));
}

// Waits until the worker has ended by itself. The caller destroys `worker`, which kills it, on an
// error.
absl::Status Wait(WorkerProcess& worker, const PhotographProcess& process,
                  const PhotographTask& task, absl::FunctionRef<bool()> wanted) {
  const absl::Time deadline = absl::Now() + process.time_limit;
  std::optional<WorkerEnd> end;
  while (!(end = worker.Poll())) {
    if (!wanted()) return NotWanted();
    if (absl::Now() > deadline) {
      return Undecodable(
          task, absl::StrCat("it takes more than ", absl::FormatDuration(process.time_limit)));
    }
    absl::SleepFor(kPoll);
  }
  // A decoder that crashed, or exceeded its CPU time, is the photograph's fault.
  if (end->kind == WorkerEnd::Kind::kKilled) {
    return Undecodable(task, absl::StrCat("the decoder ", end->description));
  }
  if (end->exit_code == 0) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(task.name, ": the decoder ", end->description));
}

// Parses the answer, and returns its picture or its error.
absl::StatusOr<PhotographPicture> ReadAnswer(OpenFile file) {
  std::string head(kPhotographHeaderBytes, '\0');
  // The answer comes from a process that has decoded a stranger's file: ParsePhotographHeader
  // checks each number against the size of the file.
  if (!file.ReadAt(0, head)) return absl::InternalError("the decoder wrote no answer");
  ASSIGN_OR_RETURN(const PhotographHeader header, ParsePhotographHeader(head, file.size()));
  if (header.code == absl::StatusCode::kOk) {
    return PhotographPicture{std::move(file), kPhotographHeaderBytes, header.num_bytes,
                             header.width, header.height};
  }
  std::string message(static_cast<size_t>(header.num_bytes), '\0');
  if (!file.ReadAt(kPhotographHeaderBytes, message)) message = "the decoder failed";
  return absl::Status(header.code, message);
}

// Runs a worker that decodes the file.
absl::StatusOr<PhotographPicture> Decode(const PhotographProcess& process,
                                         const PhotographTask& task,
                                         const std::filesystem::path& blob,
                                         absl::FunctionRef<bool()> wanted) {
  // The worker inherits both files as standard input and output, so its sandbox needs no paths.
  ASSIGN_OR_RETURN(const OpenFile input, OpenFile::ForReading(blob, task.name));
  ASSIGN_OR_RETURN(OpenFile output, OpenFile::Unnamed(process.scratch));
  WorkerCommand command;
  command.program = process.worker;
  command.log = "/dev/null";  // its errors are in its answer
  command.arguments = {absl::StrCat("--photograph=", FormatPhotographTask(task)),
                       absl::StrCat("--parent=", getpid())};
  if (!process.sandbox) command.arguments.emplace_back("--sandbox=off");
  command.environment = JobEnvironment({});
  command.inherits_environment = false;
  ASSIGN_OR_RETURN(const std::unique_ptr<WorkerProcess> worker,
                   WorkerProcess::Launch(command, {input.descriptor(), output.descriptor()}));
  RETURN_IF_ERROR(Wait(*worker, process, task, wanted));
  return ReadAnswer(std::move(output));
}

}  // namespace

// O_NONBLOCK: opening a FIFO in place of the file must not block.
absl::StatusOr<OpenFile> OpenFile::ForReading(const std::filesystem::path& path,
                                              const std::string& name) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return FileError(name, "cannot open", errno);
  return OpenFile(descriptor);
}

// Not O_TMPFILE, which some file systems do not support.
absl::StatusOr<OpenFile> OpenFile::Unnamed(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return FileError(folder, "cannot make the folder", error.value());
  std::string path = folder / "XXXXXX";
  const int descriptor = mkostemp(path.data(), O_CLOEXEC);
  if (descriptor < 0) return FileError(folder, "cannot make a file", errno);
  OpenFile file(descriptor);
  // Without a name, the file goes with its last descriptor, also when the server is killed.
  if (unlink(path.c_str()) != 0) return FileError(path, "cannot remove", errno);
  return file;
}

OpenFile::~OpenFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

int64_t OpenFile::size() const {
  struct stat facts {};
  return fstat(descriptor_, &facts) == 0 ? facts.st_size : -1;
}

bool OpenFile::ReadAt(int64_t offset, std::string& bytes) const {
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t size =
        pread(descriptor_, bytes.data() + at, bytes.size() - at, offset + static_cast<int64_t>(at));
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return false;
    at += static_cast<size_t>(size);
  }
  return true;
}

absl::StatusOr<PhotographPicture> MakePicture(const PhotographProcess& process,
                                              const PhotographTask& task,
                                              const std::filesystem::path& blob,
                                              absl::FunctionRef<bool()> wanted) {
  if (!wanted()) return NotWanted();
  if (process.failed == nullptr) return Decode(process, task, blob, wanted);
  // The file may decode and not fit the view of a model.
  const std::string key =
      absl::StrCat(task.sha256, task.form.view ? FormatView(*task.form.view) : "");
  RETURN_IF_ERROR(process.failed->Find(key, absl::Now()));
  auto picture = Decode(process, task, blob, wanted);
  if (absl::IsInvalidArgument(picture.status())) {
    process.failed->Remember(key, picture.status(), absl::Now());
  }
  return picture;
}

}  // namespace pepeseg
