# Keeps a source or robot of the clinic running on Windows: a scheduled task that starts with the
# computer, as an account without rights, and again within a minute of its end. It was written from
# the manuals and has never been run on Windows (docs/services.md). As an administrator:
#
#   .\garry.ps1 -Kind source -Name rows -Server https://garry.example.org -Options '--listen tcp://127.0.0.1:9101 --mass 75'
#   .\garry.ps1 -Kind robot -Name avatar -Server https://garry.example.org
#
# It asks for the token. To remove it: Unregister-ScheduledTask 'GARRY source rows'.
param(
    [Parameter(Mandatory)] [ValidateSet('source', 'robot')] [string] $Kind,
    [Parameter(Mandatory)] [string] $Name,
    [Parameter(Mandatory)] [string] $Server,
    [string] $Options = '',
    [string] $Garry = 'C:\garry'
)
$ErrorActionPreference = 'Stop'
$folder = Join-Path $env:ProgramData "GARRY\$Kind-$Name"
$token = Join-Path $folder 'token'
New-Item -ItemType Directory -Force $folder | Out-Null
# Only the account of the task (S-1-5-19, local service), the system and administrators: the token
# lies here, and is replaced here.
icacls $folder /inheritance:r /grant:r '*S-1-5-19:(OI)(CI)M' '*S-1-5-18:(OI)(CI)F' '*S-1-5-32-544:(OI)(CI)F' | Out-Null
if ($LASTEXITCODE -ne 0) { throw "The rights of $folder could not be set." }
if (-not (Test-Path $token)) {
    $secret = Read-Host "Token of this $Kind" -AsSecureString
    $plain = (New-Object System.Net.NetworkCredential('', $secret)).Password
    [IO.File]::WriteAllText($token, "$plain`n")
}
$words = if ($Kind -eq 'source') {
    "-m rehab.sources $Name --server $Server --token-file `"$token`" --journal `"$folder\journal`" --stay $Options"
} else {
    "-m robot --base $Name --server $Server --token-file `"$token`" --black-box `"$folder\black_box`" $Options"
}
$task = @{
    TaskName  = "GARRY $Kind $Name"
    Action    = New-ScheduledTaskAction -Execute "$Garry\.venv\Scripts\python.exe" -Argument $words -WorkingDirectory $Garry
    Trigger   = @(
        (New-ScheduledTaskTrigger -AtStartup),
        (New-ScheduledTaskTrigger -Once -At (Get-Date) -RepetitionInterval (New-TimeSpan -Minutes 1))
    )
    Settings  = New-ScheduledTaskSettingsSet -MultipleInstances IgnoreNew -ExecutionTimeLimit ([TimeSpan]::Zero) `
        -AllowStartIfOnBatteries -DontStopIfGoingOnBatteries -StartWhenAvailable
    Principal = New-ScheduledTaskPrincipal -UserId 'NT AUTHORITY\LOCAL SERVICE' -LogonType ServiceAccount
}
Register-ScheduledTask @task -Force | Out-Null
Start-ScheduledTask -TaskName $task.TaskName
