#include "server/worker_protocol/beneath_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <memory>

#include "absl/strings/str_cat.h"
#include "core/base/errors.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

namespace fs = std::filesystem;

constexpr int kFolderFlags = O_RDONLY | O_DIRECTORY;
// O_NONBLOCK: opening a FIFO must not wait for its other end.
constexpr int kFileFlags = O_RDONLY | O_NONBLOCK | O_NOCTTY;
// Removal holds one open descriptor per level of folders, so it stops at this depth. Deeper folders
// are moved to the top first.
constexpr int kMaxRemovalDepth = 32;

// Opens the path by openat2, which follows no link and does not leave the folder.
int OpenByKernel(int folder, const fs::path& relative, int flags) {
  open_how how{};
  how.flags = static_cast<uint64_t>(flags) | O_CLOEXEC;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS;
  long file = -1;
  // EAGAIN: a rename happened meanwhile, and the kernel cannot decide whether the path is beneath.
  for (int tries = 0; tries < 100; ++tries) {
    file = syscall(SYS_openat2, folder, relative.c_str(), &how, sizeof(how));
    if (file >= 0 || errno != EAGAIN) break;
  }
  return static_cast<int>(file);
}

// Opens each part of the path relative to the descriptor of the part above it, never through a
// link. Equivalent to OpenByKernel, with one system call per part.
int OpenByPart(int folder, const fs::path& relative, int flags) {
  errno = EXDEV;
  if (relative.empty() || relative.is_absolute()) return -1;
  Descriptor above;
  for (auto part = relative.begin(); part != relative.end();) {
    const fs::path& name = *part++;
    const bool last = part == relative.end();
    const int from = above.get() >= 0 ? above.get() : folder;
    const int opened =
        openat(from, name.c_str(), (last ? flags : O_PATH | O_DIRECTORY) | O_NOFOLLOW | O_CLOEXEC);
    if (opened < 0 || last) return opened;
    above = Descriptor(opened);
  }
  return -1;
}

// Returns true if an errno of open() means that the path leads to something that a worker may not
// leave there, such as a link or a device.
bool IsOfAnotherKind(int error) {
  return error == ELOOP || error == EXDEV || error == EISDIR || error == ENXIO || error == EACCES ||
         error == ENODEV;
}

absl::Status OpenError(const std::string& name, int error) {
  if (IsOfAnotherKind(error)) {
    return absl::FailedPreconditionError(absl::StrCat(name, ": not a plain file or folder"));
  }
  if (error == ENOTDIR) return absl::NotFoundError(absl::StrCat(name, ": not there"));
  return FileError(name, "open", error);
}

struct CloseFolder {
  void operator()(DIR* folder) const { closedir(folder); }
};

// File systems may report DT_UNKNOWN; then fstatat() finds the type.
BeneathFolder::Entry EntryOf(int folder, const dirent& found) {
  unsigned char type = found.d_type;
  struct stat what {};
  if (type == DT_UNKNOWN && fstatat(folder, found.d_name, &what, AT_SYMLINK_NOFOLLOW) == 0) {
    type = S_ISDIR(what.st_mode) ? DT_DIR : S_ISREG(what.st_mode) ? DT_REG : DT_UNKNOWN;
  }
  return {found.d_name, type == DT_DIR, type == DT_REG};
}

absl::StatusOr<std::vector<BeneathFolder::Entry>> EntriesIn(int folder, const std::string& name) {
  // A new descriptor, because readdir() moves the read position and closedir() closes it.
  const int again = openat(folder, ".", kFolderFlags | O_CLOEXEC);
  if (again < 0) return OpenError(name, errno);
  const std::unique_ptr<DIR, CloseFolder> stream(fdopendir(again));
  if (stream == nullptr) {
    close(again);
    return FileError(name, "list", errno);
  }
  std::vector<BeneathFolder::Entry> entries;
  errno = 0;
  while (const dirent* found = readdir(stream.get())) {
    const absl::string_view entry = found->d_name;
    if (entry != "." && entry != "..") entries.push_back(EntryOf(folder, *found));
    errno = 0;
  }
  if (errno != 0) return FileError(name, "list", errno);
  std::sort(entries.begin(), entries.end(),
            [](const auto& left, const auto& right) { return left.name < right.name; });
  return entries;
}

// Removes a folder with everything in it. Folders whose permissions the worker took away get them
// back first.
class Removal {
 public:
  // `top`: the folder that folders nested too deeply are moved to.
  explicit Removal(int top) : top_(top) {}

  // Removes entry `name` of `folder`, which is `depth` levels below the first call. Returns false
  // if something is left, with errno set.
  bool Remove(int folder, const std::string& name, int depth) {
    if (unlinkat(folder, name.c_str(), 0) == 0 || errno == ENOENT) return true;
    if (errno != EISDIR && errno != EPERM) return false;
    if (depth >= kMaxRemovalDepth) return MoveUp(folder, name);
    const Descriptor below(OpenToEmpty(folder, name));
    if (below.get() < 0) return false;
    const auto entries = EntriesIn(below.get(), name);
    if (!entries.ok()) return false;
    bool all = true;
    for (const BeneathFolder::Entry& entry : *entries) {
      all = Remove(below.get(), entry.name, depth + 1) && all;
    }
    return all && (unlinkat(folder, name.c_str(), AT_REMOVEDIR) == 0 || errno == ENOENT);
  }

  // Removes the folders that were moved up. Removing one may move up more.
  bool RemoveMoved() {
    bool all = true;
    while (!moved_.empty()) {
      const std::string name = std::move(moved_.back());
      moved_.pop_back();
      all = Remove(top_, name, 0) && all;
    }
    return all;
  }

 private:
  // Opens a folder so that its entries can be removed: with read, write and search permission.
  static int OpenToEmpty(int folder, const std::string& name) {
    const int flags = kFolderFlags | O_NOFOLLOW | O_CLOEXEC;
    int opened = openat(folder, name.c_str(), flags);
    struct stat what {};
    if (opened < 0 && errno != EACCES) return -1;
    if (opened >= 0 && fstat(opened, &what) == 0 && (what.st_mode & S_IRWXU) == S_IRWXU) {
      return opened;
    }
    // Whoever owns the folder may swap it for a link meanwhile. So the mode is set by descriptor;
    // fchmodat() would follow the link.
    if (opened >= 0) {
      fchmod(opened, S_IRWXU);
    } else if (const Descriptor path(openat(folder, name.c_str(), flags | O_PATH));
               path.get() >= 0) {
      chmod(absl::StrCat("/proc/self/fd/", path.get()).c_str(), S_IRWXU);
    }
    if (opened < 0) opened = openat(folder, name.c_str(), flags);
    return opened;
  }

  bool MoveUp(int folder, const std::string& name) {
    const std::string up = absl::StrCat(".removed-", getpid(), "-", ++num_moved_);
    if (renameat(folder, name.c_str(), top_, up.c_str()) != 0) return false;
    moved_.push_back(up);
    return true;
  }

  int top_;
  int64_t num_moved_ = 0;
  std::vector<std::string> moved_;
};

}  // namespace

Descriptor::~Descriptor() {
  if (number_ >= 0) close(number_);
}

int OpenBeneath(int folder, const fs::path& relative, int flags, bool by_kernel) {
  // The kernel would allow a ".." that stays inside the folder; OpenByPart would not.
  if (std::find(relative.begin(), relative.end(), "..") != relative.end()) {
    errno = EXDEV;
    return -1;
  }
  if (by_kernel) {
    const int file = OpenByKernel(folder, relative, flags);
    // A container's seccomp filter may refuse system calls that it does not know with EPERM.
    if (file >= 0 || (errno != ENOSYS && errno != EPERM)) return file;
  }
  return OpenByPart(folder, relative, flags);
}

std::string BeneathFolder::Name(const fs::path& relative) const {
  return (name_ / relative).string();
}

absl::StatusOr<BeneathFolder> BeneathFolder::Open(const fs::path& path) {
  Descriptor folder(open(path.c_str(), kFolderFlags | O_CLOEXEC));
  if (folder.get() < 0) return FileError(path, "open", errno);
  return BeneathFolder(std::move(folder), path.filename());
}

absl::StatusOr<BeneathFolder> BeneathFolder::OpenFolder(const fs::path& relative) const {
  Descriptor folder(OpenBeneath(folder_.get(), relative, kFolderFlags));
  if (folder.get() < 0) return OpenError(Name(relative), errno);
  return BeneathFolder(std::move(folder), Name(relative));
}

absl::StatusOr<Descriptor> BeneathFolder::OpenFile(const fs::path& relative) const {
  Descriptor file(OpenBeneath(folder_.get(), relative, kFileFlags));
  if (file.get() < 0) return OpenError(Name(relative), errno);
  // Examines the descriptor, not the path, which may lead elsewhere by now.
  struct stat what {};
  if (fstat(file.get(), &what) != 0) return FileError(Name(relative), "look at", errno);
  if (!S_ISREG(what.st_mode)) return OpenError(Name(relative), EISDIR);
  return file;
}

absl::StatusOr<std::string> BeneathFolder::ReadFile(const fs::path& relative,
                                                    int64_t max_bytes) const {
  ASSIGN_OR_RETURN(const Descriptor file, OpenFile(relative));
  // Does not rely on the file's size, because the worker may change the file meanwhile.
  std::string bytes;
  constexpr size_t kPiece = 1 << 16;
  while (true) {
    const size_t size = bytes.size();
    bytes.resize(size + kPiece);
    const ssize_t num_read = read(file.get(), bytes.data() + size, kPiece);
    if (num_read < 0 && errno == EINTR) {
      bytes.resize(size);
      continue;
    }
    if (num_read < 0) return FileError(Name(relative), "read", errno);
    bytes.resize(size + static_cast<size_t>(num_read));
    if (num_read == 0) return bytes;
    if (static_cast<int64_t>(bytes.size()) > max_bytes) {
      return absl::FailedPreconditionError(
          absl::StrCat(Name(relative), ": over ", max_bytes, " bytes"));
    }
  }
}

absl::Status BeneathFolder::CopyFiles(const fs::path& to, int64_t max_bytes) const {
  ASSIGN_OR_RETURN(const std::vector<Entry> entries, List());
  std::vector<char> piece(1 << 20);
  for (const Entry& entry : entries) {
    if (!entry.is_file) continue;
    ASSIGN_OR_RETURN(const Descriptor file, OpenFile(entry.name));
    const fs::path copy = to / entry.name;
    const Descriptor written(open(copy.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
    if (written.get() < 0) return FileError(copy, "create", errno);
    ssize_t num_read = 0;
    while ((num_read = read(file.get(), piece.data(), piece.size())) != 0) {
      if (num_read < 0) return FileError(Name(entry.name), "read", errno);
      max_bytes -= num_read;
      if (max_bytes < 0) {
        return absl::FailedPreconditionError(absl::StrCat(Name(entry.name), ": is too large"));
      }
      if (write(written.get(), piece.data(), static_cast<size_t>(num_read)) != num_read) {
        return FileError(copy, "write", errno);
      }
    }
  }
  return absl::OkStatus();
}

bool BeneathFolder::HasFile(const fs::path& relative) const { return OpenFile(relative).ok(); }

absl::StatusOr<std::vector<BeneathFolder::Entry>> BeneathFolder::List() const {
  return EntriesIn(folder_.get(), name_.string());
}

std::optional<BeneathFolder::Facts> BeneathFolder::Look(const std::string& name) const {
  struct stat what {};
  if (fstatat(folder_.get(), name.c_str(), &what, AT_SYMLINK_NOFOLLOW) != 0) return std::nullopt;
  if (!S_ISREG(what.st_mode)) return std::nullopt;
  return Facts{static_cast<int64_t>(what.st_size), static_cast<int64_t>(what.st_nlink),
               absl::TimeFromTimespec(what.st_mtim)};
}

absl::StatusOr<int64_t> BeneathFolder::CheckPlain(bool other_names) const {
  int64_t num_bytes = 0;
  ASSIGN_OR_RETURN(const std::vector<Entry> entries, List());
  for (const Entry& entry : entries) {
    const std::optional<Facts> facts = Look(entry.name);
    if (!facts) {
      return absl::FailedPreconditionError(absl::StrCat(Name(entry.name), ": not a plain file"));
    }
    if (!other_names && facts->num_names != 1) {
      return absl::FailedPreconditionError(absl::StrCat(Name(entry.name), ": has a second name"));
    }
    num_bytes += facts->num_bytes;
  }
  return num_bytes;
}

absl::Status BeneathFolder::RemoveAll(const std::string& name) const {
  Removal removal(folder_.get());
  const bool removed = removal.Remove(folder_.get(), name, 0);
  if (removal.RemoveMoved() && removed) return absl::OkStatus();
  // Tries once more: a folder that still had entries at the first attempt may be empty now.
  if (removal.Remove(folder_.get(), name, 0) && removal.RemoveMoved()) return absl::OkStatus();
  return FileError(Name(name), "remove", errno);
}

absl::Status RemoveBeneath(const fs::path& folder, const fs::path& relative) {
  const absl::StatusOr<BeneathFolder> top = BeneathFolder::Open(folder);
  if (absl::IsNotFound(top.status())) return absl::OkStatus();
  RETURN_IF_ERROR(top.status());
  // Links are refused on the way to the parent; the last part is removed even if it is a link.
  const std::string name = relative.filename();
  if (!relative.has_parent_path()) return top->RemoveAll(name);
  const absl::StatusOr<BeneathFolder> parent = top->OpenFolder(relative.parent_path());
  if (absl::IsNotFound(parent.status())) return absl::OkStatus();
  RETURN_IF_ERROR(parent.status());
  return parent->RemoveAll(name);
}

}  // namespace pepeseg
