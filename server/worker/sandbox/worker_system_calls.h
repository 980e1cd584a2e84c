#pragma once

#include "absl/strings/string_view.h"

// The system calls that the worker's sandbox allows, or kills the process for, in groups with the
// reason for each. Names that the machine's libseccomp does not know are ignored.
namespace pepeseg {

// Files: the dataset, the results, libraries; locks and temporary files of SQLite in COLMAP.
// Landlock decides which files, and AllowOpening has the conditions of open and openat. Not listed
// are links, which would lead readers of the results elsewhere; chown, mknod, chroot, mount;
// truncate by path; and io_uring, whose operations no filter sees.
inline constexpr absl::string_view kFileCalls =
    "access chdir chmod close close_range copy_file_range creat dup dup2 dup3 faccessat "
    "faccessat2 fadvise64 fallocate fchdir fchmod fchmodat fcntl fdatasync fgetxattr flistxattr "
    "flock fstat fstatfs fsync ftruncate futimesat getcwd getdents getdents64 getxattr "
    "inotify_add_watch inotify_init1 inotify_rm_watch lgetxattr listxattr llistxattr lseek "
    "lstat mkdir mkdirat newfstatat pipe pipe2 pread64 preadv preadv2 pwrite64 pwritev pwritev2 "
    "read readahead readlink readlinkat readv rename renameat renameat2 rmdir sendfile splice "
    "stat statfs statx sync_file_range syncfs umask unlink unlinkat utime utimensat utimes write "
    "writev";

inline constexpr absl::string_view kMemoryCalls =
    "brk get_mempolicy madvise membarrier memfd_create mincore mlock mlock2 mmap mprotect "
    "mremap msync munlock munmap pkey_alloc pkey_free pkey_mprotect";

// Threads and locks of the C library. AllowThreads has the conditions of clone.
inline constexpr absl::string_view kThreadCalls =
    "arch_prctl exit exit_group futex futex_waitv get_robust_list get_thread_area getcpu gettid "
    "rseq sched_get_priority_max sched_get_priority_min sched_getaffinity sched_getattr "
    "sched_getparam sched_getscheduler sched_rr_get_interval sched_setaffinity sched_yield "
    "set_robust_list set_thread_area set_tid_address";

inline constexpr absl::string_view kTimeCalls =
    "alarm clock_getres clock_gettime clock_nanosleep getitimer gettimeofday nanosleep "
    "setitimer time timer_create timer_delete timer_getoverrun timer_gettime timer_settime "
    "timerfd_create timerfd_gettime timerfd_settime times";

// Signals, and waiting for descriptors. AllowSignals has the conditions of the calls that send
// signals.
inline constexpr absl::string_view kSignalCalls =
    "epoll_create epoll_create1 epoll_ctl epoll_pwait epoll_pwait2 epoll_wait eventfd eventfd2 "
    "pause poll ppoll pselect6 restart_syscall rt_sigaction rt_sigpending rt_sigprocmask "
    "rt_sigreturn rt_sigsuspend rt_sigtimedwait select sigaltstack signalfd signalfd4";

// Pairs of sockets between a process and its children. AllowSockets has the conditions for making
// them. No connect.
inline constexpr absl::string_view kSocketCalls =
    "getpeername getsockname getsockopt recvfrom recvmmsg recvmsg sendmmsg sendmsg sendto "
    "setsockopt shutdown";

inline constexpr absl::string_view kAboutItselfCalls =
    "capget getegid geteuid getgid getgroups getpgid getpgrp getpid getppid getpriority "
    "getrandom getresgid getresuid getrlimit getrusage getsid getuid ioprio_get prctl sysinfo "
    "uname";

// CUDA's driver, in the worker or in a priors command: pinned and shared memory, memory near a
// processor, priorities of its threads. It does everything else by ioctl on its devices.
inline constexpr absl::string_view kDeviceCalls =
    "io_cancel io_destroy io_getevents io_setup io_submit mbind mlockall move_pages munlockall "
    "sched_setattr sched_setparam sched_setscheduler semctl semget semop semtimedop "
    "set_mempolicy setpriority shmat shmctl shmdt shmget";

// CUDA's driver listens on an abstract socket (@cuda-uvmfd-...), and fails where it cannot (seen on
// an H100). Nothing needs to connect to it.
inline constexpr absl::string_view kDeviceSocketCalls = "bind listen";

// COLMAP and the priors command: to start them, to wait for them, and what shells and Python's own
// processes need. No setsid: a process that leaves its group would outlive the job.
inline constexpr absl::string_view kProgramCalls =
    "execve execveat fork ioprio_set personality setpgid vfork wait4 waitid";

inline constexpr absl::string_view kSanitizerCalls = "personality ptrace wait4 waitid";

// Calls that kill the process, since no worker makes them: other processes' memory, the kernel's
// code, the machine's state, keys, file systems, and the calls with which attacks on the kernel
// start.
inline constexpr absl::string_view kAttackCalls =
    "acct add_key bpf delete_module finit_module fsconfig fsmount fsopen init_module ioperm "
    "iopl kexec_file_load kexec_load keyctl lookup_dcookie mount mount_setattr move_mount "
    "nfsservctl open_by_handle_at open_tree perf_event_open pivot_root process_madvise "
    "process_vm_readv process_vm_writev quotactl reboot request_key setdomainname sethostname "
    "swapoff swapon syslog umount2 userfaultfd vhangup";

inline constexpr absl::string_view kDebuggerCalls = "ptrace";

}  // namespace pepeseg
