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

        /// <summary>The last failure to read or write; empty if there was none.</summary>
        public string Problem { get; private set; } = "";

        public void Store(string host, int port, byte[] key)
        {
            Host = host;
            Port = port;
            Key = key;
            Write(pairingPath, System.Text.Encoding.UTF8.GetBytes(
                DeviceId.ToString("x16") + "\n" + host + "\n" + port + "\n" + Convert.ToBase64String(key)));
        }

        /// <summary>The calibrations of earlier sessions; none if there is no file.</summary>
        public Kept ReadKept()
        {
            try
            {
                return File.Exists(keptPath) ? Kept.FromBytes(File.ReadAllBytes(keptPath)) : new Kept();
            }
            catch (Exception error) when (error is IOException || error is MalformedException)
            {
                Problem = "The kept calibrations cannot be read (" + error.Message + "): calibrate again.";
                return new Kept();
            }
        }

        public void StoreKept(byte[] kept)
        {
            Write(keptPath, kept);
        }

        void Read()
        {
            try
            {
                if (File.Exists(pairingPath))
                {
                    string[] lines = File.ReadAllLines(pairingPath);
                    DeviceId = ulong.Parse(lines[0], System.Globalization.NumberStyles.HexNumber);
                    Port = int.Parse(lines[2]);
                    Key = Convert.FromBase64String(lines[3]);
                    Host = lines[1];
                    return;
                }
            }
            catch (Exception error)
                when (error is IOException || error is FormatException || error is IndexOutOfRangeException)
            {
                Problem = "The pairing cannot be read (" + error.Message + "): scan the QR code again.";
            }
            DeviceId = BitConverter.ToUInt64(Keys.RandomBytes(8), 0);
        }

        /// <summary>Writes a file as a whole or not at all.</summary>
        void Write(string path, byte[] content)
        {
            try
            {
                string part = path + ".part";
                File.WriteAllBytes(part, content);
                if (File.Exists(path)) File.Replace(part, path, null);
                else File.Move(part, path);
            }
            catch (IOException error)
            {
                Problem = "Cannot write " + path + ": " + error.Message;
            }
        }
    }
}
