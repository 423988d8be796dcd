// Library for LD_PRELOAD: one call of the system that changes files, or the n-th of one kind, goes wrong on purpose.
//   FAULT_AT=5                    number of the call, counted from 1; 0 only counts
//   FAULT_CALLS=write,rename      calls that count (default: all)
//   FAULT_ACTION=28               number of the error, or kill, term, int, or 0.5s for a delay before the call
//   FAULT_UNDER=/path             only calls on files, by relative paths or by those that begin like this
//   FAULT_FROM=1                  all calls from that one on go wrong
//   FAULT_CLOCK=-3600             the clock of the day is off by so many seconds
//   FAULT_NO_EXCHANGE=1           the file system cannot exchange names
//   FAULT_LOG=path                each counted call, one line
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

static int count = 0;

static void note(const char *call, const char *subject)
{
   const char *path = getenv("FAULT_LOG");
   char line[512];
   int log, length;

   if (!path) return;
   log = (int)syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
   length = snprintf(line, sizeof line, "%d %s %.400s\n", count, call, subject);
   syscall(SYS_write, log, line, length);
   syscall(SYS_close, log);
}

// The number of the error with which this call has to fail, or 0.
static int fault(const char *call, const char *subject)
{
   const char *calls = getenv("FAULT_CALLS"), *at = getenv("FAULT_AT"), *action = getenv("FAULT_ACTION"), *found;
   const char *under = getenv("FAULT_UNDER");
   size_t length = strlen(call);
   int error, number;

   if (!at) return 0;
   // Descriptors without a file have names such as socket:[1].
   if (under && strncmp(subject, under, strlen(under)) != 0 && (subject[0] == '/' || strstr(subject, ":["))) return 0;
   if (calls) {
      for (found = strstr(calls, call); found; found = strstr(found + 1, call))
         if ((found == calls || found[-1] == ',') && (!found[length] || found[length] == ',')) break;
      if (!found) return 0;
   }
   number = __atomic_add_fetch(&count, 1, __ATOMIC_SEQ_CST);
   note(call, subject);
   if (getenv("FAULT_FROM") ? number < atoi(at) : number != atoi(at)) return 0;
   if (atoi(at) == 0 || !action) return 0;
   if (strcmp(action, "kill") == 0) kill(getpid(), SIGKILL);
   else if (strcmp(action, "term") == 0) kill(getpid(), SIGTERM);
   else if (strcmp(action, "int") == 0) kill(getpid(), SIGINT);
   else if (action[strlen(action) - 1] == 's') usleep((useconds_t)(1e6 * atof(action)));
   else {
      error = atoi(action);
      errno = error;
      return error;
   }
   return 0;
}

#define NEXT(type, name, ...) ((type (*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name))

static const char *of(int descriptor)
{
   static __thread char path[256];
   char link[64];
   ssize_t length;

   snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
   length = readlink(link, path, sizeof path - 1);
   path[length < 0 ? 0 : length] = 0;
   return path;
}

ssize_t write(int descriptor, const void *bytes, size_t length)
{
   if (fault("write", of(descriptor))) return -1;
   return NEXT(ssize_t, write, int, const void *, size_t)(descriptor, bytes, length);
}

// Where they are named only: they change nothing.
ssize_t read(int descriptor, void *bytes, size_t length)
{
   if (getenv("FAULT_CALLS") && fault("read", of(descriptor))) return -1;
   return NEXT(ssize_t, read, int, void *, size_t)(descriptor, bytes, length);
}

int close(int descriptor)
{
   int flags = fcntl(descriptor, F_GETFL);

   // An error of the disk may come with the last of the data.
   if (flags >= 0 && (flags & O_ACCMODE) != O_RDONLY && fault("close", of(descriptor))) {
      syscall(SYS_close, descriptor);
      return -1;
   }
   return NEXT(int, close, int)(descriptor);
}

#define ON_OPEN(name)                                                     \
   int name(const char *path, int flags, ...)                             \
   {                                                                      \
      va_list rest;                                                       \
      mode_t mode;                                                        \
                                                                          \
      va_start(rest, flags);                                              \
      mode = va_arg(rest, mode_t);                                        \
      va_end(rest);                                                       \
      if ((flags & O_ACCMODE) != O_RDONLY && fault(#name, path)) return -1; \
      return NEXT(int, name, const char *, int, ...)(path, flags, mode);  \
   }
#define ON_PATH(name)                                                     \
   int name(const char *path)                                             \
   {                                                                      \
      if (fault(#name, path)) return -1;                                  \
      return NEXT(int, name, const char *)(path);                         \
   }
#define ON_PATHS(name)                                                    \
   int name(const char *path, const char *other)                          \
   {                                                                      \
      if (fault(#name, other)) return -1;                                 \
      return NEXT(int, name, const char *, const char *)(path, other);    \
   }
#define ON_DESCRIPTOR(name)                                               \
   int name(int descriptor)                                               \
   {                                                                      \
      if (fault(#name, of(descriptor))) return -1;                        \
      return NEXT(int, name, int)(descriptor);                            \
   }

ON_OPEN(open)
ON_OPEN(open64)
ON_PATH(unlink)
ON_PATH(remove)
ON_PATH(rmdir)
ON_PATHS(rename)
ON_PATHS(link)
ON_DESCRIPTOR(fsync)
ON_DESCRIPTOR(fdatasync)
ON_DESCRIPTOR(syncfs)

int flock(int descriptor, int operation)
{
   if (fault("flock", of(descriptor))) return -1;
   return NEXT(int, flock, int, int)(descriptor, operation);
}

int mkdir(const char *path, mode_t mode)
{
   if (fault("mkdir", path)) return -1;
   return NEXT(int, mkdir, const char *, mode_t)(path, mode);
}

int renameat2(int old, const char *path, int new, const char *other, unsigned flags)
{
   if (getenv("FAULT_NO_EXCHANGE")) {
      errno = EINVAL;
      return -1;
   }
   if (fault("renameat2", other)) return -1;
   return NEXT(int, renameat2, int, const char *, int, const char *, unsigned)(old, path, new, other, flags);
}

static time_t shift(void)
{
   const char *seconds = getenv("FAULT_CLOCK");

   return seconds ? (time_t)atoll(seconds) : 0;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
   int status = NEXT(int, clock_gettime, clockid_t, struct timespec *)(clock, now);

   if (status == 0 && clock == CLOCK_REALTIME) now->tv_sec += shift();
   return status;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone)
{
   int status = NEXT(int, gettimeofday, struct timeval *restrict, void *restrict)(now, zone);

   if (status == 0) now->tv_sec += shift();
   return status;
}

time_t time(time_t *copy)
{
   time_t now = NEXT(time_t, time, time_t *)(NULL) + shift();

   if (copy) *copy = now;
   return now;
}
