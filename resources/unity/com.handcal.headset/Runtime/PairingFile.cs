using System;
using System.IO;
using Handcal.Link;

namespace Handcal
{
    /// <summary>The headset's memory: its identity, the PC, the key, and the calibrations.</summary>
    sealed class PairingFile
    {
        readonly string pairingPath, keptPath;

        public PairingFile(string folder)
        {
            pairingPath = Path.Combine(folder, "handcal-pairing.txt");
            keptPath = Path.Combine(folder, "handcal-calibrations.bin");
            Read();
        }

        public ulong DeviceId { get; private set; }
        public string Host { get; private set; } = "";
        public int Port { get; private set; }
        public byte[] Key { get; private set; } = new byte[Keys.MinPairingKeyBytes];
        public bool IsPaired { get { return Host.Length > 0; } }

        /// <summary>The component's invitation by which it was paired; that is not used again.</summary>
        public string UsedInvitation { get; private set; } = "";

        /// <summary>The last failure to read or write; empty if there was none.</summary>
        public string Problem { get; private set; } = "";

        /// <summary>Stores a pairing; false if it will be forgotten with the app.</summary>
        public bool Store(string host, int port, byte[] key, string usedInvitation)
        {
            UsedInvitation = usedInvitation;
            Host = host;
            Port = port;
            Key = key;
            return Write(pairingPath, System.Text.Encoding.UTF8.GetBytes(
                DeviceId.ToString("x16") + "\n" + host + "\n" + port + "\n" + Convert.ToBase64String(key)
                + "\n" + usedInvitation));
        }

        /// <summary>Reads the calibrations of earlier sessions, none if there is no file; false if it is damaged.</summary>
        public bool TryReadKept(out Kept kept)
        {
            kept = new Kept();
            try
            {
                if (File.Exists(keptPath)) kept = Kept.FromBytes(File.ReadAllBytes(keptPath));
                return true;
            }
            catch (Exception error) when (IsOfFile(error) || error is MalformedException)
            {
                Problem = "The kept calibrations cannot be read (" + error.Message + "): calibrate again.";
                return false;
            }
        }

        public bool StoreKept(byte[] kept)
        {
            return Write(keptPath, kept);
        }

        void Read()
        {
            try
            {
                if (File.Exists(pairingPath))
                {
                    string[] lines = File.ReadAllLines(pairingPath);
                    ulong device = ulong.Parse(lines[0], System.Globalization.NumberStyles.HexNumber);
                    byte[] key = Convert.FromBase64String(lines[3]);
                    if (key.Length < Keys.MinPairingKeyBytes || !Invitation.IsPort(int.Parse(lines[2])))
                        throw new FormatException("no key and port");
                    DeviceId = device;
                    Key = key;
                    Port = int.Parse(lines[2]);
                    Host = lines[1];
                    if (lines.Length > 4) UsedInvitation = lines[4];
                    return;
                }
            }
            catch (Exception error)
                when (IsOfFile(error) || error is FormatException || error is OverflowException
                    || error is IndexOutOfRangeException)
            {
                Problem = "The pairing cannot be read (" + error.Message + "): pair again.";
            }
            DeviceId = BitConverter.ToUInt64(Keys.RandomBytes(8), 0);
        }

        static bool IsOfFile(Exception error)
        {
            return error is IOException || error is UnauthorizedAccessException;
        }

        /// <summary>Writes a file as a whole or not at all.</summary>
        bool Write(string path, byte[] content)
        {
            try
            {
                string part = path + ".part";
                File.WriteAllBytes(part, content);
                if (File.Exists(path)) File.Replace(part, path, null);
                else File.Move(part, path);
                return true;
            }
            catch (Exception error) when (IsOfFile(error))
            {
                Problem = "Cannot write " + path + ": " + error.Message;
                return false;
            }
        }
    }
}
