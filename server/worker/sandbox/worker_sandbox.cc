#include "server/worker/sandbox/worker_sandbox.h"

#include <fcntl.h>
#include <sched.h>
#include <seccomp.h>
#include <spdlog/spdlog.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <initializer_list>
#include <string>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/base/status_macros.h"
#include "server/worker/sandbox/worker_landlock.h"
#include "server/worker/sandbox/worker_limits.h"

namespace pepeseg {
namespace {

// The system calls that the sandbox allows, or kills the process for, in groups with the reason for
// each. Names that the machine's libseccomp does not know are ignored.

// Files: the dataset, the results, libraries; locks and temporary files of SQLite in COLMAP.
// Landlock decides which files, and AllowOpening has the conditions of open and openat. Not listed
// are links, which would lead readers of the results elsewhere; mknod, chroot, mount; io_uring,
// whose operations no filter sees; and the calls that change a file without opening it for writing,
// which Landlock does not cover: chmod, chown, the utime family, extended attributes, truncate by
// path.
constexpr absl::string_view kFileCalls =
    "access chdir close close_range copy_file_range creat dup dup2 dup3 faccessat "
    "faccessat2 fadvise64 fallocate fchdir fcntl fdatasync fgetxattr flistxattr "
    "flock fstat fstatfs fsync ftruncate getcwd getdents getdents64 getxattr "
    "inotify_add_watch inotify_init1 inotify_rm_watch lgetxattr listxattr llistxattr lseek "
    "lstat mkdir mkdirat newfstatat pipe pipe2 pread64 preadv preadv2 pwrite64 pwritev pwritev2 "
    "read readahead readlink readlinkat readv rename renameat renameat2 rmdir sendfile splice "
    "stat statfs statx sync_file_range syncfs umask unlink unlinkat write writev";

constexpr absl::string_view kMemoryCalls =
    "brk get_mempolicy madvise membarrier memfd_create mincore mlock mlock2 mmap mprotect "
    "mremap msync munlock munmap pkey_alloc pkey_free pkey_mprotect";

// Threads and locks of the C library. AllowThreads has the conditions of clone.
constexpr absl::string_view kThreadCalls =
    "arch_prctl exit exit_group futex futex_waitv get_robust_list get_thread_area getcpu gettid "
    "rseq sched_get_priority_max sched_get_priority_min sched_getaffinity sched_getattr "
    "sched_getparam sched_getscheduler sched_rr_get_interval sched_setaffinity sched_yield "
    "set_robust_list set_thread_area set_tid_address";

constexpr absl::string_view kTimeCalls =
    "alarm clock_getres clock_gettime clock_nanosleep getitimer gettimeofday nanosleep "
    "setitimer time timer_create timer_delete timer_getoverrun timer_gettime timer_settime "
    "timerfd_create timerfd_gettime timerfd_settime times";

// Signals, and waiting for descriptors. AllowSignals has the conditions of the calls that send
// signals.
constexpr absl::string_view kSignalCalls =
    "epoll_create epoll_create1 epoll_ctl epoll_pwait epoll_pwait2 epoll_wait eventfd eventfd2 "
    "pause poll ppoll pselect6 restart_syscall rt_sigaction rt_sigpending rt_sigprocmask "
    "rt_sigreturn rt_sigsuspend rt_sigtimedwait select sigaltstack signalfd signalfd4";

// Pairs of sockets between a process and its children. AllowSockets has the conditions for making
// them. No connect.
constexpr absl::string_view kSocketCalls =
    "getpeername getsockname getsockopt recvfrom recvmmsg recvmsg sendmmsg sendmsg sendto "
    "setsockopt shutdown";

constexpr absl::string_view kAboutItselfCalls =
    "capget getegid geteuid getgid getgroups getpgid getpgrp getpid getppid getpriority "
    "getrandom getresgid getresuid getrlimit getrusage getsid getuid ioprio_get prctl sysinfo "
    "uname";

// CUDA's driver, in the worker or in a priors command: pinned and shared memory, memory near a
// processor. It does everything else by ioctl on its devices. AllowPriorities has the conditions
// of the calls for the priorities of its threads.
constexpr absl::string_view kDeviceCalls =
    "io_cancel io_destroy io_getevents io_setup io_submit mbind mlockall move_pages munlockall "
    "semctl semget semop semtimedop set_mempolicy shmat shmctl shmdt shmget";

// CUDA's driver listens on an abstract socket (@cuda-uvmfd-...), and fails where it cannot (seen on
// an H100). Nothing needs to connect to it.
constexpr absl::string_view kDeviceSocketCalls = "bind listen";

// COLMAP and the priors command: to start them, to wait for them, and what shells and Python's own
// processes need. No setsid: a program that left the worker's process group would outlive the job.
constexpr absl::string_view kProgramCalls = "execve execveat fork personality vfork wait4 waitid";

constexpr absl::string_view kSanitizerCalls = "personality ptrace wait4 waitid";

// Calls that kill the process, since no worker makes them: other processes' memory, the kernel's
// code, the machine's state, keys, file systems, and the calls with which attacks on the kernel
// start.
constexpr absl::string_view kAttackCalls =
    "acct add_key bpf delete_module finit_module fsconfig fsmount fsopen init_module ioperm "
    "iopl kexec_file_load kexec_load keyctl lookup_dcookie mount mount_setattr move_mount "
    "nfsservctl open_by_handle_at open_tree perf_event_open pivot_root process_madvise "
    "process_vm_readv process_vm_writev quotactl reboot request_key setdomainname sethostname "
    "swapoff swapon syslog umount2 userfaultfd vhangup";

constexpr absl::string_view kDebuggerCalls = "ptrace";

constexpr uint64_t kLowerHalf = 0xffffffff;

// A filter of system calls by libseccomp. The first error is kept, and Enter returns it.
class Filter {
 public:
  // `otherwise`: the action for calls without a rule.
  explicit Filter(uint32_t otherwise) : context_(seccomp_init(otherwise)) {
    if (context_ == nullptr) error_ = ENOMEM;
  }
  ~Filter() {
    if (context_ != nullptr) seccomp_release(context_);
  }
  Filter(const Filter&) = delete;
  Filter& operator=(const Filter&) = delete;

  void Allow(absl::string_view calls) { AddEach(SCMP_ACT_ALLOW, calls); }
  void Kill(absl::string_view calls) { AddEach(SCMP_ACT_KILL_PROCESS, calls); }
  // Answers ENOSYS, as a kernel without the call does; programs then use an older call.
  void AnswerUnknown(const char* call) { Add(SCMP_ACT_ERRNO(ENOSYS), call, {}); }
  // Answers success and does nothing.
  void Pretend(const char* call) { Add(SCMP_ACT_ERRNO(0), call, {}); }
  // Makes the kernel log refused calls.
  void Log() { Keep(seccomp_attr_set(context_, SCMP_FLTATR_CTL_LOG, 1)); }
  // Allows a call if all of `conditions` hold, which must be of different arguments. Several rules
  // of one call are alternatives.
  void AllowIf(const char* call, std::initializer_list<scmp_arg_cmp> conditions) {
    Add(SCMP_ACT_ALLOW, call, conditions);
  }
  // Answers EPERM if the condition holds.
  void RefuseIf(const char* call, scmp_arg_cmp condition) {
    Add(SCMP_ACT_ERRNO(EPERM), call, {condition});
  }

  absl::Status Enter() {
    // TSYNC: for all threads, should there be more than one. OPTIMIZE 2: compares in a binary tree.
    Keep(seccomp_attr_set(context_, SCMP_FLTATR_CTL_TSYNC, 1));
    Keep(seccomp_attr_set(context_, SCMP_FLTATR_CTL_OPTIMIZE, 2));
    if (error_ == 0) Keep(seccomp_load(context_));
    if (error_ == 0) return absl::OkStatus();
    return absl::InternalError(absl::StrCat(
        "sandbox: seccomp", where_, ": ", std::generic_category().message(error_),
        "; if this machine has no seccomp, pepesegd --sandbox=off runs jobs without a sandbox"));
  }

 private:
  void AddEach(uint32_t action, absl::string_view calls) {
    for (const absl::string_view call : absl::StrSplit(calls, ' ')) {
      Add(action, std::string(call), {});
    }
  }
  void Add(uint32_t action, const std::string& call,
           std::initializer_list<scmp_arg_cmp> conditions) {
    if (error_ != 0) return;
    const int number = seccomp_syscall_resolve_name(call.c_str());
    // This libseccomp does not know the call, so it is refused like all that are not listed.
    if (number == __NR_SCMP_ERROR) return;
    Keep(seccomp_rule_add_array(context_, action, number, static_cast<unsigned>(conditions.size()),
                                conditions.begin()));
    if (error_ != 0) where_ = absl::StrCat(" (", call, ")");
  }
  // Keeps the first error.
  void Keep(int result) {
    if (error_ == 0 && result < 0) error_ = -result;
  }

  scmp_filter_ctx context_;
  int error_ = 0;
  std::string where_;
};

// Allows harmless requests to terminals only: TIOCSTI would type into the operator's shell. The
// kernel uses the lower half of the request, so only that is compared.
void AllowDeviceControl(Filter& filter) {
  for (const unsigned long request : {TCGETS, TIOCGWINSZ, FIONREAD, FIONBIO, FIONCLEX, FIOCLEX}) {
    filter.AllowIf("ioctl", {SCMP_A1(SCMP_CMP_MASKED_EQ, kLowerHalf, request)});
  }
  // Any request whose type, its second byte, is not that of terminals: one of the bits differs.
  constexpr uint64_t kTerminal = uint64_t{'T'} << 8;
  for (uint64_t bit = 1 << 8; bit <= 1 << 15; bit <<= 1) {
    filter.AllowIf("ioctl", {SCMP_A1(SCMP_CMP_MASKED_EQ, bit, ~kTerminal & bit)});
  }
}

// Allows new threads and, if `processes`, new processes, but no new namespaces.
void AllowThreads(Filter& filter, bool processes) {
  constexpr uint64_t kNamespaces = CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC |
                                   CLONE_NEWUSER | CLONE_NEWPID | CLONE_NEWNET;
  if (processes) {
    filter.AllowIf("clone", {SCMP_A0(SCMP_CMP_MASKED_EQ, kNamespaces, 0)});
  } else {
    filter.AllowIf("clone",
                   {SCMP_A0(SCMP_CMP_MASKED_EQ, kNamespaces | CLONE_THREAD, CLONE_THREAD)});
  }
}

// Allows sockets that cannot reach another process: no call connects, and datagram sockets, which
// could send to a name without connecting, cannot be made.
void AllowSockets(Filter& filter, bool has_device) {
  constexpr uint64_t kTypes = 0xf;  // the rest is SOCK_CLOEXEC and SOCK_NONBLOCK
  for (const uint64_t type : {SOCK_STREAM, SOCK_SEQPACKET}) {
    const scmp_arg_cmp local = SCMP_A0(SCMP_CMP_MASKED_EQ, kLowerHalf, AF_UNIX);
    const scmp_arg_cmp ordered = SCMP_A1(SCMP_CMP_MASKED_EQ, kTypes, type);
    filter.AllowIf("socketpair", {local, ordered});
    if (has_device && type == SOCK_SEQPACKET) filter.AllowIf("socket", {local, ordered});
  }
  if (has_device) filter.Allow(kDeviceSocketCalls);
}

// Allows open and openat, but not O_TRUNC on a file that is opened for reading: it truncates all
// the same, and Landlock covers truncation only from Linux 6.2 on. openat2 has its flags in memory,
// where a filter cannot look, so it is hidden; callers then use openat.
void AllowOpening(Filter& filter) {
  constexpr uint64_t kMode = O_ACCMODE, kTruncates = O_TRUNC;
  const auto flags = [&](const char* call, uint64_t mask, uint64_t value) {
    const bool at = call[4] != '\0';
    filter.AllowIf(call, {at ? SCMP_A2(SCMP_CMP_MASKED_EQ, mask, value)
                             : SCMP_A1(SCMP_CMP_MASKED_EQ, mask, value)});
  };
  for (const char* call : {"open", "openat"}) {
    flags(call, kTruncates, 0);
    flags(call, kMode | kTruncates, O_WRONLY | O_TRUNC);
    flags(call, kMode | kTruncates, O_RDWR | O_TRUNC);
  }
  filter.AnswerUnknown("openat2");
}

// Allows signals. A process that starts no others can signal only itself; of one that does, the
// children's process ids are not known here.
void AllowSignals(Filter& filter, bool processes) {
  const auto self = static_cast<uint64_t>(getpid());
  for (const char* call : {"kill", "tgkill", "rt_sigqueueinfo", "rt_tgsigqueueinfo"}) {
    if (processes) {
      filter.AllowIf(call, {});
    } else {
      filter.AllowIf(call, {SCMP_A0(SCMP_CMP_MASKED_EQ, kLowerHalf, self)});
    }
  }
}

// Allows priorities that do not take the processor or the disk from the server, even if that runs
// as root: the policies that share time, niceness of at least 0, and no real-time class of I/O. No
// sched_setattr, whose policy is in memory, where a filter cannot look.
void AllowPriorities(Filter& filter) {
  for (const uint64_t policy : {SCHED_OTHER, SCHED_BATCH, SCHED_IDLE}) {
    filter.AllowIf("sched_setscheduler", {SCMP_A1(SCMP_CMP_MASKED_EQ, kLowerHalf, policy)});
  }
  // Negative numbers are large ones here.
  constexpr uint64_t kNicest = 19;
  filter.AllowIf("setpriority", {SCMP_A2(SCMP_CMP_LE, kNicest)});
  constexpr uint64_t kClassOf = 0xe000, kBestEffort = 2 << 13, kIdle = 3 << 13;
  for (const uint64_t io_class : {uint64_t{0}, kBestEffort, kIdle}) {
    filter.AllowIf("ioprio_set", {SCMP_A2(SCMP_CMP_MASKED_EQ, kClassOf, io_class)});
  }
}

// Refuses what the second filter cannot except from its rules: of several filters the strictest
// action counts. Without a log, since every new thread tries clone3.
//
// clone3 is hidden, so that the C library uses clone: the flags of clone3 are in memory, where a
// filter cannot look. The requests to file systems change the attributes of a file that is opened
// for reading (FS_IOC_SETFLAGS, FS_IOC_FSSETXATTR, FS_IOC_SETVERSION, FS_IOC_ENABLE_VERITY,
// FAT_IOCTL_SET_ATTRIBUTES); no device that CUDA uses has their types.
absl::Status EnterFirstFilter() {
  Filter filter(SCMP_ACT_ALLOW);
  filter.AnswerUnknown("clone3");
  constexpr uint64_t kType = 0xff00;
  for (const char type : {'f', 'X', 'v', 'r'}) {
    filter.RefuseIf("ioctl",
                    SCMP_A1(SCMP_CMP_MASKED_EQ, kType, uint64_t{static_cast<uint8_t>(type)} << 8));
  }
  return filter.Enter();
}

absl::Status LimitSystemCalls(const SandboxNeeds& needs) {
  Filter filter(SCMP_ACT_ERRNO(EPERM));
  filter.Log();
  filter.Allow("clone3");  // EnterFirstFilter answers it
  // SQLite in COLMAP and std::filesystem::copy_file ask for the mode that a file has anyway, and
  // the latter fails if it is refused.
  filter.Pretend("fchmod");
  filter.Allow(kFileCalls);
  filter.Allow(kMemoryCalls);
  filter.Allow(kThreadCalls);
  filter.Allow(kTimeCalls);
  filter.Allow(kSignalCalls);
  filter.Allow(kSocketCalls);
  filter.Allow(kAboutItselfCalls);
  AllowDeviceControl(filter);
  AllowOpening(filter);
  AllowSignals(filter, needs.runs_programs || kSanitized);
  AllowThreads(filter, needs.runs_programs || kSanitized);
  AllowSockets(filter, needs.has_device);
  if (needs.has_device || needs.runs_programs) {
    filter.Allow(kDeviceCalls);
    AllowPriorities(filter);
  }
  if (needs.runs_programs) {
    filter.Allow(kProgramCalls);
    // Shells stop when it fails. Programs stay in the worker's group, which group_guard.h ends.
    filter.Pretend("setpgid");
  }
  // A sanitizer looks for leaks in a process of its own, which stops all threads of this one.
  if (kSanitized) filter.Allow(kSanitizerCalls);
  // Limits can be read but not changed; a CUDA driver may lower those of this process.
  if (needs.has_device) {
    filter.AllowIf("prlimit64", {SCMP_A0(SCMP_CMP_EQ, 0)});
  } else {
    filter.AllowIf("prlimit64", {SCMP_A0(SCMP_CMP_EQ, 0), SCMP_A2(SCMP_CMP_EQ, 0)});
  }
  filter.Kill(kAttackCalls);
  if (!kSanitized) filter.Kill(kDebuggerCalls);
  return filter.Enter();
}

}  // namespace

absl::Status EnterSandbox(const SandboxNeeds& needs) {
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) {
    return absl::InternalError(
        absl::StrCat("sandbox: no_new_privs: ", std::generic_category().message(errno)));
  }
  // On a kernel without Landlock the filter of system calls is still entered; the log says what is
  // missing. The flag above is required for both by a process without privileges.
  const absl::Status files = LimitFiles(needs);
  if (absl::IsFailedPrecondition(files)) {
    spdlog::warn("sandbox: {}", std::string(files.message()));
  } else {
    RETURN_IF_ERROR(files);
  }
  // First, since the second filter does not allow seccomp itself.
  RETURN_IF_ERROR(EnterFirstFilter());
  return LimitSystemCalls(needs);
}

}  // namespace pepeseg
