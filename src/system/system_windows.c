// Operating system calls that Fortran lacks, by those of Windows. Paths are UTF-8, with slashes. Functions return 0, or the
// number of the system's error, unless stated otherwise; what they promise stands in system_posix.c and system.f90.
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
#include <limits.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <wchar.h>

// Longest path in UTF-16, and in UTF-8.
#define LONGEST 4096

const char thud_separator = '\\';
volatile sig_atomic_t thud_latest_signal = 0;
// Windows does not fork processes.
volatile sig_atomic_t thud_is_forked = 0;
static atomic_int running = 0;
static int is_executable = 0;

// Windows calls this in a thread of its own: of the library first, then of what hosts it, such as Python. The executable
// ends at the third request.
static BOOL WINAPI record_event(DWORD event)
{
   static atomic_int count = 0;

   (void)event;
   if (running > 0) thud_latest_signal = SIGINT;
   if (is_executable && ++count == 3) ExitProcess(128 + SIGINT);
   return is_executable;
}

void thud_begin_call(void)
{
   static atomic_flag hooked = ATOMIC_FLAG_INIT;

   running++;
   if (!atomic_flag_test_and_set(&hooked)) SetConsoleCtrlHandler(record_event, TRUE);
}

void thud_interrupt_calls(void)
{
   if (running > 0) thud_latest_signal = SIGINT;
}

void thud_end_call(void)
{
   if (--running == 0) thud_latest_signal = 0;
}

void thud_prepare_process(void)
{
   is_executable = 1;
   SetConsoleOutputCP(CP_UTF8);
   thud_begin_call();
}

void thud_get_error_text(int number, char *text, size_t length)
{
   wchar_t wide[512];
   DWORD count = FormatMessageW(FORMAT_MESSAGE_FROM_SYSTEM | FORMAT_MESSAGE_IGNORE_INSERTS, NULL, (DWORD)number,
      MAKELANGID(LANG_ENGLISH, SUBLANG_ENGLISH_US), wide, 512, NULL);

   // The last two are those of the end of the line.
   while (count > 0 && wcschr(L".\r\n", wide[count - 1])) count--;
   count = (DWORD)WideCharToMultiByte(CP_UTF8, 0, wide, (int)count, text, (int)length - 1, NULL, NULL);
   text[count] = 0;
   if (count == 0) snprintf(text, length, "error %d of Windows", number);
}

// A path in UTF-16; none is longer than LONGEST.
static const wchar_t *wide(const char *path, wchar_t text[LONGEST])
{
   if (!MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, text, LONGEST)) wcscpy(text, L"?");
   return text;
}

int thud_write(const char *path, int descriptor, const char *bytes, size_t length)
{
   wchar_t text[LONGEST];
   DWORD count;
   int error = 0;
   HANDLE file = *path ? CreateFileW(wide(path, text), FILE_APPEND_DATA, FILE_SHARE_READ, NULL, OPEN_ALWAYS, 0, NULL)
      : GetStdHandle(descriptor == 1 ? STD_OUTPUT_HANDLE : STD_ERROR_HANDLE);

   if (file == INVALID_HANDLE_VALUE || !file) return *path ? (int)GetLastError() : 0;
   // Consoles take less than 64 KiB at a time.
   for (; length > 0 && !error; bytes += count, length -= count)
      if (!WriteFile(file, bytes, length < 16384 ? (DWORD)length : 16384, &count, NULL)) error = (int)GetLastError();
   if (*path && !CloseHandle(file) && !error) error = (int)GetLastError();
   return !*path && (error == ERROR_BROKEN_PIPE || error == ERROR_NO_DATA || error == ERROR_INVALID_HANDLE) ? 0 : error;
}

int thud_make_directory(const char *path)
{
   wchar_t text[LONGEST];

   if (CreateDirectoryW(wide(path, text), NULL)) return 0;
   return GetLastError() == ERROR_ALREADY_EXISTS ? -ERROR_ALREADY_EXISTS : (int)GetLastError();
}

int thud_remove(const char *path)
{
   wchar_t text[LONGEST];

   return DeleteFileW(wide(path, text)) || RemoveDirectoryW(text) ? 0 : (int)GetLastError();
}

// Windows cannot exchange names: the other directory is `NAME.old` for a moment. If a program has a file in it open, it stays.
int thud_swap(const char *path, const char *target)
{
   wchar_t new[LONGEST], there[LONGEST], old[LONGEST];
   DWORD error;

   wide(path, new);
   wide(target, there);
   if (wcslen(there) + 5 > LONGEST) return ERROR_FILENAME_EXCED_RANGE;
   swprintf(old, LONGEST, L"%ls.old", there);
   RemoveDirectoryW(there);
   if (MoveFileExW(new, there, MOVEFILE_WRITE_THROUGH)) return -1;
   if (!MoveFileExW(there, old, MOVEFILE_WRITE_THROUGH)) return (int)GetLastError();
   if (MoveFileExW(new, there, MOVEFILE_WRITE_THROUGH))
      return MoveFileExW(old, new, MOVEFILE_WRITE_THROUGH) ? 0 : (int)GetLastError();
   error = GetLastError();
   MoveFileExW(old, there, MOVEFILE_WRITE_THROUGH);
   return (int)error;
}

int thud_get_real_path(const char *path, char *text, size_t length)
{
   wchar_t given[LONGEST], found[LONGEST];
   const wchar_t *begin = found;
   DWORD count;
   HANDLE file = CreateFileW(wide(path, given), 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, NULL,
      OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, NULL);

   // What is missing has no links.
   count = file == INVALID_HANDLE_VALUE ? GetFullPathNameW(given, LONGEST, found, NULL)
      : GetFinalPathNameByHandleW(file, found, LONGEST, 0);
   if (file != INVALID_HANDLE_VALUE) CloseHandle(file);
   if (count == 0 || count >= LONGEST) return ERROR_FILENAME_EXCED_RANGE;
   // Of a drive `\\?\C:\...`, of a share `\\?\UNC\server\...`.
   if (wcsncmp(found, L"\\\\?\\UNC\\", 8) == 0) begin = wmemcpy(found + 6, L"\\", 1);
   else if (wcsncmp(found, L"\\\\?\\", 4) == 0) begin = found + 4;
   if (!WideCharToMultiByte(CP_UTF8, 0, begin, -1, text, (int)length, NULL, NULL)) return ERROR_FILENAME_EXCED_RANGE;
   for (; *text; text++)
      if (*text == '\\') *text = '/';
   return 0;
}

// Path as the C library takes it, in the code page of the process.
int thud_get_native_path(const char *path, char *text, size_t length)
{
   wchar_t given[LONGEST];

   return WideCharToMultiByte(CP_ACP, 0, wide(path, given), -1, text, (int)length, NULL, NULL) ? 0 : (int)GetLastError();
}

long long thud_get_size(const char *path)
{
   wchar_t text[LONGEST];
   WIN32_FILE_ATTRIBUTE_DATA found;

   if (!GetFileAttributesExW(wide(path, text), GetFileExInfoStandard, &found)) return -1;
   if (found.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) return -2;
   return (long long)found.nFileSizeHigh << 32 | found.nFileSizeLow;
}

int thud_list(const char *path, char *names, size_t length)
{
   wchar_t text[LONGEST];
   WIN32_FIND_DATAW entry;
   size_t used = 0;
   int count = 1;
   HANDLE search;

   wide(path, text);
   if (wcslen(text) + 3 > LONGEST) return -1;
   search = FindFirstFileW(wcscat(text, L"/*"), &entry);
   if (search == INVALID_HANDLE_VALUE) return -1;
   do {
      if (wcscmp(entry.cFileName, L".") == 0 || wcscmp(entry.cFileName, L"..") == 0) continue;
      count = WideCharToMultiByte(CP_UTF8, 0, entry.cFileName, -1, names + used, (int)(length - used), NULL, NULL);
      used += (size_t)count;
      if (count > 0) names[used - 1] = '/';
   } while (count > 0 && FindNextFileW(search, &entry));
   FindClose(search);
   return count > 0 && used < length ? (int)used : -1;
}
