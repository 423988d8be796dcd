// Operating system calls that Fortran lacks, with the system's own headers.
// Paths are UTF-8. Functions return 0, or the number of the error, unless stated otherwise.
#define _GNU_SOURCE
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#ifdef _WIN32
#include <windows.h>
#include <wchar.h>

// Longest path.
#define LONGEST 4096

// A path in UTF-16, which the C library of Windows needs for all that is no ASCII.
static const wchar_t *to_wide(const char *path, wchar_t text[LONGEST])
{
   if (!MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, text, LONGEST)) wcscpy(text, L"?");
   return text;
}

static const char *to_utf8(const wchar_t *path, char text[LONGEST])
{
   if (!WideCharToMultiByte(CP_UTF8, 0, path, -1, text, LONGEST, NULL, NULL)) strcpy(text, "?");
   return text;
}

// Scanners of viruses hold new files for a moment.
static int rename_wide(const wchar_t *path, const wchar_t *target)
{
   for (int i = 0; i < 10; i++) {
      if (_wrename(path, target) == 0) return 0;
      if (errno != EACCES) return -1;
      Sleep(50);
   }
   return -1;
}

// Windows keeps what is read only.
static int remove_wide(const wchar_t *path)
{
   _wchmod(path, _S_IREAD | _S_IWRITE);
   return _wremove(path) == 0 ? 0 : _wrmdir(path);
}

#define WIDE(path) to_wide(path, (wchar_t[LONGEST]){0})
#define OPEN(path) _wopen(WIDE(path), O_WRONLY | O_CREAT | O_APPEND | O_BINARY | O_NOINHERIT, 0666)
#define mkdir(path, mode) _wmkdir(WIDE(path))
#define remove(path) remove_wide(WIDE(path))
#define rename(path, target) rename_wide(WIDE(path), WIDE(target))
#else
#define LONGEST PATH_MAX
#define OPEN(path) open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666)
#endif

// Number of the signal that asks to end the work, 0 for none; long loops check it through the module thud_interrupt.
volatile sig_atomic_t thud_latest_signal = 0;

// 1 in a process forked from one that had called the library: it has none of the threads of OpenMP, which would be waited
// for.
volatile sig_atomic_t thud_is_forked = 0;

// Number of running calls.
static atomic_int running = 0;

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

#ifdef _WIN32
static int is_executable = 0;
static UINT code_page;

// Windows calls this in a thread of its own: of the library first, then of what hosts it, such as Python. The executable
// ends at the third request.
static BOOL WINAPI record_event(DWORD event)
{
   static atomic_int count = 0;

   (void)event;
   thud_interrupt_calls();
   if (is_executable && ++count == 3) ExitProcess(128 + SIGINT);
   return is_executable;
}

void thud_begin_call(void)
{
   static atomic_flag hooked = ATOMIC_FLAG_INIT;

   running++;
   if (!atomic_flag_test_and_set(&hooked)) SetConsoleCtrlHandler(record_event, TRUE);
}

static void restore_screen(void)
{
   SetConsoleOutputCP(code_page);
}

// Until the process ends the screen takes UTF-8, and line feeds as they are.
void thud_prepare_process(void)
{
   is_executable = 1;
   code_page = GetConsoleOutputCP();
   SetConsoleOutputCP(CP_UTF8);
   atexit(restore_screen);
   for (int i = 1; i <= STDERR_FILENO; i++) _setmode(i, O_BINARY);
   thud_begin_call();
}
#else
// The process that called last, 0 for none.
static _Atomic pid_t caller = 0;

// Handlers of the process, which `record_signal` calls too.
static const int ending_signals[] = {SIGINT, SIGTERM};
static void (*handlers[2])(int);

static void record_signal(int number)
{
   static volatile sig_atomic_t nested = 0;

   if (running > 0) thud_latest_signal = number;
   // Another library may have saved this handler and call it from its own handler.
   if (nested) return;
   nested = 1;
   handlers[number == SIGTERM](number);
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
      if (sigaction(ending_signals[i], NULL, &action) != 0 || action.sa_flags & SA_SIGINFO
          || action.sa_handler == record_signal || action.sa_handler == SIG_DFL || action.sa_handler == SIG_IGN) continue;
      handlers[i] = action.sa_handler;
      action.sa_handler = record_signal;
      sigaction(ending_signals[i], &action, NULL);
   }
   atomic_flag_clear(&hooking);
}

// Handler of the executable: some callers send a signal both to the process and to its group.
static void end_at_third(int number)
{
   static volatile sig_atomic_t count = 0;

   if (++count == 3) _exit(128 + number);
}

// Begins a call as long as the process: no file gets the descriptor of a closed standard stream, writing to a full file or a
// closed pipe is an error and not a signal.
void thud_prepare_process(void)
{
   struct sigaction action;

   for (int i = 0; i <= STDERR_FILENO; i++)
      if (fcntl(i, F_GETFD) < 0 && open("/dev/null", i == STDIN_FILENO ? O_WRONLY : O_RDONLY) < 0) return;
   signal(SIGPIPE, SIG_IGN);
   signal(SIGXFSZ, SIG_IGN);
   for (int i = 0; i < 2; i++) {
      if (sigaction(ending_signals[i], NULL, &action) != 0 || action.sa_handler == SIG_IGN) continue;
      action.sa_handler = end_at_third;
      sigaction(ending_signals[i], &action, NULL);
   }
   thud_begin_call();
}
#endif

// Message of an error, at most `length` bytes including the final zero.
void thud_get_error_text(int number, char *text, size_t length)
{
   snprintf(text, length, "%s", strerror(number));
}

// Writes a whole text to a descriptor, or to the end of a file, which it creates if it is missing. A closed pipe or standard
// stream has no reader: no error.
int thud_write(const char *path, int descriptor, const char *bytes, size_t length)
{
   int file = *path ? OPEN(path) : descriptor;
   int error = file < 0 ? errno : 0;

   while (length > 0 && !error) {
      ssize_t count = write(file, bytes, length < INT_MAX ? (unsigned)length : INT_MAX);

      if (count < 0 && errno != EINTR) error = errno;
      bytes += count > 0 ? count : 0;
      length -= count > 0 ? (size_t)count : 0;
   }
   // Some systems report a full disk only when the file is closed.
   if (*path && file >= 0 && close(file) != 0 && !error) error = errno;
#ifdef _WIN32
   if (!*path && error == EINVAL) error = EPIPE;
#endif
   return error == EPIPE || error == EBADF ? 0 : error;
}

// Removes a file or an empty directory.
int thud_remove(const char *path)
{
   return remove(path) == 0 ? 0 : errno;
}

// Size of a regular file, 0 of pipes and devices; -1 if nothing has the path, -2 of a directory.
long long thud_get_size(const char *path)
{
#ifdef _WIN32
   WIN32_FILE_ATTRIBUTE_DATA found;

   if (!GetFileAttributesExW(WIDE(path), GetFileExInfoStandard, &found)) return -1;
   if (found.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) return -2;
   return (long long)found.nFileSizeHigh << 32 | found.nFileSizeLow;
#else
   struct stat found;

   if (stat(path, &found) != 0) return -1;
   return S_ISDIR(found.st_mode) ? -2 : found.st_size;
#endif
}

// Path as Fortran opens it, in the code page of the process on Windows; at most `length` bytes including the final zero.
int thud_get_native_path(const char *path, char *text, size_t length)
{
#ifdef _WIN32
   // Of UTF-8 all is found; other pages lack letters, for which another path would be opened.
   BOOL lacks = FALSE;
   int is_utf8 = GetACP() == CP_UTF8;

   if (WideCharToMultiByte(CP_ACP, is_utf8 ? 0 : WC_NO_BEST_FIT_CHARS, WIDE(path), -1, text, (int)length, NULL,
         is_utf8 ? NULL : &lacks) && !lacks) return 0;
   // No file has this name.
   path = "?";
#endif
   return (size_t)snprintf(text, length, "%s", path) < length ? 0 : ENAMETOOLONG;
}

// Makes a directory; -EEXIST if the path exists.
int thud_make_directory(const char *path)
{
   return mkdir(path, 0777) == 0 ? 0 : errno == EEXIST ? -EEXIST : errno;
}

// Puts a directory in the place of another one, which then has its path, in one step if the system can exchange names; else
// the other one is `NAME.old` for a moment. -1 if it was missing or empty: nothing of the caller has the path then.
int thud_swap(const char *path, const char *target)
{
   char old[LONGEST];
   int error;
#ifdef _WIN32

   // Windows replaces no directory, not even an empty one.
   _wrmdir(WIDE(target));
   if (rename(path, target) == 0) return -1;
#else
   struct stat there;

   if (rename(path, target) == 0) return -1;
   error = errno;
   if (stat(target, &there) != 0) return error;
   if (chmod(path, there.st_mode & 07777) != 0) return errno;
#endif
#if defined RENAME_EXCHANGE
   if (renameat2(AT_FDCWD, path, AT_FDCWD, target, RENAME_EXCHANGE) == 0) return 0;
   if (errno != EINVAL && errno != ENOSYS && errno != ENOTSUP) return errno;
#elif defined RENAME_SWAP
   if (renamex_np(path, target, RENAME_SWAP) == 0) return 0;
   if (errno != ENOTSUP) return errno;
#endif
   if ((size_t)snprintf(old, sizeof old, "%s.old", target) >= sizeof old) return ENAMETOOLONG;
   // What has that name is not ours.
   if (rename(target, old) != 0) {
      if ((size_t)snprintf(old, sizeof old, "%s.old", path) >= sizeof old) return ENAMETOOLONG;
      if (rename(target, old) != 0) return errno;
   }
   if (rename(path, target) == 0) return rename(old, path) == 0 ? 0 : errno;
   error = errno;
   return rename(old, target) == 0 ? error : errno;
}

// Path without links, at most `length` bytes including the final zero.
int thud_get_real_path(const char *path, char *text, size_t length)
{
   char resolved[LONGEST];
#ifdef _WIN32
   wchar_t found[LONGEST];
   HANDLE file = CreateFileW(WIDE(path), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, NULL, OPEN_EXISTING,
      FILE_FLAG_BACKUP_SEMANTICS, NULL);
   DWORD count = GetFinalPathNameByHandleW(file, found, LONGEST, 0);

   if (file != INVALID_HANDLE_VALUE) CloseHandle(file);
   // What is missing has no links, and some file systems know none.
   if (count == 0) count = GetFullPathNameW(WIDE(path), LONGEST, found, NULL);
   if (count == 0 || count >= LONGEST) return ENAMETOOLONG;
   if (count > 3 && found[count - 1] == L'\\') found[count - 1] = 0;
   to_utf8(found, resolved);
   for (char *at = resolved; *at; at++)
      if (*at == '\\') *at = '/';
   // The system writes drives as `//?/C:/...`, shares as `//?/UNC/server/...`.
   if (strncmp(resolved, "//?/UNC/", 8) == 0) memmove(resolved + 1, resolved + 7, strlen(resolved + 7) + 1);
   else if (strncmp(resolved, "//?/", 4) == 0) memmove(resolved, resolved + 4, strlen(resolved + 4) + 1);
#else

   if (!realpath(path, resolved)) return errno;
#endif
   return (size_t)snprintf(text, length, "%s", resolved) < length ? 0 : ENAMETOOLONG;
}

// Adds a name and a slash to names in a directory, but for the directory itself and its parent.
static void add_name(const char *name, char *names, size_t length, size_t *used)
{
   if (*used < length && strcmp(name, ".") != 0 && strcmp(name, "..") != 0)
      *used += (size_t)snprintf(names + *used, length - *used, "%s/", name);
}

// Names in a directory, each with a slash behind it; their length, or a negative number if they cannot be read or are longer.
int thud_list(const char *path, char *names, size_t length)
{
   size_t used = 0;
#ifdef _WIN32
   char pattern[LONGEST], name[LONGEST];
   WIN32_FIND_DATAW entry;
   HANDLE search;

   if ((size_t)snprintf(pattern, sizeof pattern, "%s/*", path) >= sizeof pattern) return -1;
   search = FindFirstFileW(WIDE(pattern), &entry);
   if (search == INVALID_HANDLE_VALUE) return -1;
   do add_name(to_utf8(entry.cFileName, name), names, length, &used);
   while (FindNextFileW(search, &entry));
   FindClose(search);
#else
   DIR *directory = opendir(path);
   struct dirent *entry;

   if (!directory) return -1;
   while ((entry = readdir(directory))) add_name(entry->d_name, names, length, &used);
   closedir(directory);
#endif
   return used < length ? (int)used : -1;
}
