// Library for LD_PRELOAD: one call of the system that changes files goes wrong on purpose.
//   FAULT_AT=5             number of the call, counted from 1
//   FAULT_ACTION=28        number of the error, or kill or int
//   FAULT_UNDER=/path      only calls on files, by relative paths or by those that begin like this
//   FAULT_NO_EXCHANGE=1    the file system cannot exchange names
//   FAULT_NO_LOCKS=1       the file system has no locks
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

static int count = 0;

// Whether this call has to fail; `errno` is the error then.
static int fails(const char *subject)
{
   const char *at = getenv("FAULT_AT"), *action = getenv("FAULT_ACTION"), *under = getenv("FAULT_UNDER");

   if (!at || !action || !under) return 0;
   // Descriptors without a file have names such as socket:[1].
   if (strncmp(subject, under, strlen(under)) != 0 && (subject[0] == '/' || strstr(subject, ":["))) return 0;
   if (__atomic_add_fetch(&count, 1, __ATOMIC_SEQ_CST) != atoi(at)) return 0;
   if (strcmp(action, "kill") == 0) kill(getpid(), SIGKILL);
   if (strcmp(action, "int") == 0) kill(getpid(), SIGINT);
   errno = atoi(action);
   return errno != 0;
}

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

static int opens(const char *path, int flags)
{
   return (flags & O_ACCMODE) != O_RDONLY && fails(path);
}

#define CALL(type, name, subject, parameters, ...)                                       \
   type name parameters                                                                  \
   {                                                                                     \
      if (fails(subject)) return -1;                                                     \
      return ((type (*) parameters)dlsym(RTLD_NEXT, #name))(__VA_ARGS__);                \
   }
#define OPEN(name)                                                                       \
   int name(const char *path, int flags, ...)                                            \
   {                                                                                     \
      va_list rest;                                                                      \
      mode_t mode;                                                                       \
                                                                                         \
      va_start(rest, flags);                                                             \
      mode = va_arg(rest, mode_t);                                                       \
      va_end(rest);                                                                      \
      if (opens(path, flags)) return -1;                                                 \
      return ((int (*)(const char *, int, ...))dlsym(RTLD_NEXT, #name))(path, flags, mode); \
   }

OPEN(open)
OPEN(open64)
CALL(ssize_t, write, of(file), (int file, const void *bytes, size_t length), file, bytes, length)
CALL(int, unlink, path, (const char *path), path)
CALL(int, remove, path, (const char *path), path)
CALL(int, rmdir, path, (const char *path), path)
CALL(int, mkdir, path, (const char *path, mode_t mode), path, mode)
CALL(int, rename, other, (const char *path, const char *other), path, other)
CALL(int, fsync, of(file), (int file), file)
CALL(int, fdatasync, of(file), (int file), file)
CALL(int, syncfs, of(file), (int file), file)

int close(int file)
{
   int flags = fcntl(file, F_GETFL);

   // An error of the disk may come with the last of the data.
   if (flags >= 0 && opens(of(file), flags)) {
      syscall(SYS_close, file);
      return -1;
   }
   return ((int (*)(int))dlsym(RTLD_NEXT, "close"))(file);
}

int renameat2(int old, const char *path, int new, const char *other, unsigned flags)
{
   errno = EINVAL;
   if (getenv("FAULT_NO_EXCHANGE") || fails(other)) return -1;
   return ((int (*)(int, const char *, int, const char *, unsigned))dlsym(RTLD_NEXT, "renameat2"))(old, path, new, other,
                                                                                                  flags);
}

int flock(int file, int operation)
{
   errno = ENOLCK;
   if (getenv("FAULT_NO_LOCKS")) return -1;
   return ((int (*)(int, int))dlsym(RTLD_NEXT, "flock"))(file, operation);
}
