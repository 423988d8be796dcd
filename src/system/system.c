// Operating system calls that Fortran lacks, with the system's own headers.
// Functions return 0, or the number of the error, unless stated otherwise.
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <math.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

// Number of the signal that asks to end the work, 0 for none; long loops check it through the module thud_interrupt.
volatile sig_atomic_t thud_latest_signal = 0;

// 1 in a process forked from one that had called the library: it has none of the threads of OpenMP, which would be waited
// for.
volatile sig_atomic_t thud_is_forked = 0;

// The process that called last, 0 for none, and its number of running calls.
static _Atomic pid_t caller = 0;
static atomic_int running = 0;

// Handlers of the process, which `record_signal` calls too.
static const int ending_signals[] = {SIGINT, SIGTERM};
static struct sigaction handlers[2];

static void record_signal(int number, siginfo_t *information, void *context)
{
   static volatile sig_atomic_t nested = 0;
   const struct sigaction *handler = &handlers[number == SIGTERM];

   if (running > 0) thud_latest_signal = number;
   // Another library may have saved this handler and call it from its own handler.
   if (nested) return;
   nested = 1;
   if (handler->sa_flags & SA_SIGINFO) handler->sa_sigaction(number, information, context);
   else handler->sa_handler(number);
   nested = 0;
}

// Marks a call as running; signals that the process handles then also interrupt it.
void thud_begin_call(void)
{
   static atomic_flag hooking = ATOMIC_FLAG_INIT;
   struct sigaction action;
   pid_t before = atomic_exchange(&caller, getpid());

   if (before != 0 && before != caller) {
      thud_is_forked = 1;
      running = 0;
      thud_latest_signal = 0;
   }
   running++;
   if (atomic_flag_test_and_set(&hooking)) return;
   for (int i = 0; i < 2; i++) {
      if (sigaction(ending_signals[i], NULL, &action) != 0 || action.sa_sigaction == record_signal
          || action.sa_handler == SIG_DFL || action.sa_handler == SIG_IGN) continue;
      handlers[i] = action;
      action.sa_sigaction = record_signal;
      action.sa_flags |= SA_SIGINFO;
      sigaction(ending_signals[i], &action, NULL);
   }
   atomic_flag_clear(&hooking);
}

// Interrupts the running calls.
void thud_interrupt_calls(void)
{
   if (running > 0) thud_latest_signal = SIGINT;
}

// Marks the end of a call.
void thud_end_call(void)
{
   if (--running == 0) thud_latest_signal = 0;
}

// Handler of the executable: the work ends in order, and the process at the third signal, as some callers send one both to
// the process and to its group.
static void interrupt(int number)
{
   static volatile sig_atomic_t count = 0;

   thud_latest_signal = number;
   if (++count == 3) _exit(128 + number);
}

// Prepares the process of the executable: writing to a full file or a closed pipe is an error and not a signal, no file
// gets the descriptor of a closed standard stream, SIGINT and SIGTERM end the work.
void thud_prepare_process(void)
{
   struct sigaction action = {.sa_handler = SIG_IGN}, before;

   for (int i = 0; i <= STDERR_FILENO; i++)
      if (fcntl(i, F_GETFD) < 0 && open("/dev/null", i == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0) return;
   sigaction(SIGPIPE, &action, NULL);
   sigaction(SIGXFSZ, &action, NULL);
   action.sa_handler = interrupt;
   for (int i = 0; i < 2; i++)
      if (sigaction(ending_signals[i], NULL, &before) == 0 && before.sa_handler != SIG_IGN)
         sigaction(ending_signals[i], &action, NULL);
}

// Limit of the memory of the container, bytes, in version 2 or 1 of control groups below a directory; infinite if there is
// none.
double thud_get_container_limit(const char *directory)
{
   static const char *const names[] = {"memory.max", "memory/memory.limit_in_bytes"};
   double limit = INFINITY;
   char path[256];

   for (int i = 0; i < 2; i++) {
      snprintf(path, sizeof path, "%s/%s", directory, names[i]);
      FILE *file = fopen(path, "re");

      // Version 2 writes "max" for no limit.
      if (file && fscanf(file, "%lf", &limit) != 1) limit = INFINITY;
      if (file) fclose(file);
      if (limit < INFINITY) break;
   }
   return limit;
}

// 1 if there is address space for that many bytes and, if `check_available` is set, the system does not report that less
// memory is available.
int thud_has_memory(double bytes, int check_available)
{
   size_t wanted = bytes < 1e18 ? (size_t)bytes : (size_t)1e18;
   void *block = mmap(NULL, wanted, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
   char line[128];
   double kilobytes, free = -1.0;
   FILE *file;

   if (block == MAP_FAILED) return 0;
   munmap(block, wanted);
   if (!check_available) return 1;
   // Linux promises more memory than it has, and ends a process that then writes to it.
   file = fopen("/proc/meminfo", "re");
   if (!file) return 1;
   while (fgets(line, sizeof line, file)) {
      if (sscanf(line, "MemAvailable: %lf", &kilobytes) == 1) free = (free < 0.0 ? 0.0 : free) + 1024.0*kilobytes;
      if (sscanf(line, "SwapFree: %lf", &kilobytes) == 1 && free >= 0.0) free += 1024.0*kilobytes;
   }
   fclose(file);
   return (free < 0.0 || bytes <= free) && bytes <= thud_get_container_limit("/sys/fs/cgroup");
}

// Message of an error, at most `length` bytes including the final zero.
void thud_get_error_text(int number, char *text, size_t length)
{
   snprintf(text, length, "%s", strerror(number));
}

// A descriptor to write to a new file, or minus the number of the error.
int thud_create(const char *path)
{
   int descriptor = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);

   return descriptor < 0 ? -errno : descriptor;
}

// Writes a whole text. A closed pipe or standard stream has no reader: no error.
int thud_write(int descriptor, const char *bytes, size_t length)
{
   while (length > 0) {
      ssize_t count = write(descriptor, bytes, length);

      if (count < 0 && errno == EINTR) continue;
      if (count < 0) return errno == EPIPE || errno == EBADF ? 0 : errno;
      bytes += count;
      length -= (size_t)count;
   }
   return 0;
}

// Closes a file; some systems report a full disk only then.
int thud_close(int descriptor)
{
   return close(descriptor) == 0 ? 0 : errno;
}

// Absolute path without links, at most `length` bytes; creates missing parent directories.
static int resolve(const char *path, char *resolved, size_t length)
{
   char above[PATH_MAX], *real_path, *end;
   const char *name = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
   size_t used = (size_t)snprintf(above, sizeof above, "%s", path);

   if (used >= sizeof above) return ENAMETOOLONG;
   for (end = above; *end && (end = strchr(end + 1, '/')); *end = '/') {
      *end = 0;
      if (mkdir(above, 0777) != 0) continue;
   }
   real_path = realpath(path, NULL);
   if (real_path) {
      used = (size_t)snprintf(resolved, length, "%s", real_path);
   } else {
      above[name - path] = 0;
      real_path = errno == ENOENT ? realpath(*above ? above : ".", NULL) : NULL;
      if (!real_path) return errno;
      used = (size_t)snprintf(resolved, length, "%s/%s", real_path[1] ? real_path : "", name);
   }
   free(real_path);
   return used < length ? 0 : ENAMETOOLONG;
}

// Makes a new directory beside a target, which may be missing: `.NAME.<process>-<number>.new`. Creates missing parents.
int thud_make_beside(const char *target, char *path, size_t length)
{
   char resolved[PATH_MAX], *name;
   int error = resolve(target, resolved, sizeof resolved);

   if (error) return error;
   name = strrchr(resolved, '/') + 1;
   for (int i = 1; i <= 1000; i++) {
      int used = snprintf(path, length, "%.*s.%s.%ld-%d.new", (int)(name - resolved), resolved, name, (long)getpid(), i);

      if ((size_t)used >= length) return ENAMETOOLONG;
      if (mkdir(path, 0777) == 0) return 0;
      if (errno != EEXIST) return errno;
   }
   return EEXIST;
}

// Puts a directory in the place of a target, which then has the path of the first, in one step if the file system can
// exchange names; else the target is `NAME.old` for a moment.
int thud_swap(const char *path, const char *place)
{
   char target[PATH_MAX], old[PATH_MAX];
   struct stat there;
   int error = resolve(place, target, sizeof target);

   if (error) return error;
   // The target is missing or empty.
   if (rename(path, target) == 0) return 0;
   if (stat(target, &there) == 0 && chmod(path, there.st_mode & 07777) != 0) return errno;
#if defined RENAME_EXCHANGE
   if (renameat2(AT_FDCWD, path, AT_FDCWD, target, RENAME_EXCHANGE) == 0) return 0;
   if (errno != EINVAL && errno != ENOSYS && errno != ENOTSUP) return errno;
#elif defined RENAME_SWAP
   if (renamex_np(path, target, RENAME_SWAP) == 0) return 0;
   if (errno != ENOTSUP) return errno;
#endif
   if ((size_t)snprintf(old, sizeof old, "%s.old", target) >= sizeof old) return ENAMETOOLONG;
   if (rename(target, old) != 0) return errno;
   if (rename(path, target) == 0) return rename(old, path) == 0 ? 0 : errno;
   error = errno;
   return rename(old, target) == 0 ? error : errno;
}

// 1 if two paths lead to the same file.
int thud_is_same_file(const char *path, const char *other)
{
   struct stat here, there;

   return stat(path, &here) == 0 && stat(other, &there) == 0 && here.st_dev == there.st_dev && here.st_ino == there.st_ino;
}

// Names in a directory, each with a slash behind it, as far as they fit; returns the length of all of them.
int thud_list(const char *path, char *names, size_t length)
{
   DIR *directory = opendir(path);
   struct dirent *entry;
   int used = 0;

   while (directory && (entry = readdir(directory))) {
      const char *name = entry->d_name;
      int size = (int)strlen(name) + 1;

      if (strcmp(name, ".") == 0 || strcmp(name, "..") == 0) continue;
      if ((size_t)(used + size) <= length) snprintf(names + used, length - (size_t)used + 1, "%s/", name);
      used += size;
   }
   if (directory) closedir(directory);
   return used;
}
